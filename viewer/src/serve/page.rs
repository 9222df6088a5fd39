//! The page: one HTML file with its style and its program inside, so that it needs nothing else.

/// The page as it is sent. `nonce` marks its own style and program, the only ones that its browser will accept.
pub(super) fn html(nonce: &str) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The page is whole and asks no other server.
    #[test]
    fn page() {
        let page = html("0123abcd");
        assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
        let absent = ["/*STYLE*/", "/*PROGRAM*/", "NONCE", "http://", "https://", "//cdn", "@import", "url("];
        // One more end would end the program in the middle of the page.
        let counts = [("nonce=\"0123abcd\"", 2), ("</script>", 1), ("</style>", 1)];
        for (text, count) in counts.into_iter().chain(absent.map(|text| (text, 0))) {
            assert_eq!(page.matches(text).count(), count, "{text}");
        }
    }
}
