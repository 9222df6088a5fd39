//! The web page: a single HTML file with embedded styles and scripts.

use std::net::TcpStream;

/// Returns the page. Its styles and scripts carry `nonce`, and the browser accepts no others.
fn html(nonce: &str) -> String {
    const PAGE: &str = include_str!("page/index.html");
    const STYLE: &str = include_str!("page/page.css");
    const PARTS: [&str; 5] = [
        include_str!("page/plot.js"),
        include_str!("page/joints.js"),
        include_str!("page/stage.js"),
        include_str!("page/timeline.js"),
        include_str!("page/page.js"),
    ];
    PAGE.replace("NONCE", nonce).replace("/*STYLE*/", STYLE).replace("/*PROGRAM*/", &PARTS.join("\n"))
}

/// Web pages that may show the page in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FrameAncestors {
    None,
    ThisMachine,
}

impl FrameAncestors {
    /// Sources of the directive `frame-ancestors` (Content Security Policy, level 3). It has no notation for IPv6
    /// addresses.
    fn sources(self) -> &'static str {
        match self {
            Self::None => "'none'",
            Self::ThisMachine => "http://localhost:* https://localhost:* http://127.0.0.1:* https://127.0.0.1:*",
        }
    }
}

/// Sends the page with status 200.
pub(super) fn send(stream: &mut TcpStream, nonce: &str, frames: FrameAncestors, with_body: bool) {
    let policy = format!(
        "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; img-src blob: \
         data:; base-uri 'none'; form-action 'none'; frame-ancestors {}",
        frames.sources()
    );
    let more = [("Content-Security-Policy", policy.as_str()), ("Content-Type", "text/html; charset=utf-8")];
    kinetoscope_http::send(stream, "200 OK", &more, &html(nonce), with_body);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page is complete and requests nothing from other servers.
    #[test]
    fn page() {
        let page = html("0123abcd");
        assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
        let absent = ["/*STYLE*/", "/*PROGRAM*/", "NONCE", "http://", "https://", "//cdn", "@import", "url("];
        // Another closing tag would end the script in the middle of the page.
        let counts = [("nonce=\"0123abcd\"", 2), ("</script>", 1), ("</style>", 1)];
        for (text, count) in counts.into_iter().chain(absent.map(|text| (text, 0))) {
            assert_eq!(page.matches(text).count(), count, "{text}");
        }
    }
}
