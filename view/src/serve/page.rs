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

    #[test]
    fn the_page_is_whole_and_asks_nobody_else() {
        let page = html("0123abcd");
        assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
        assert_eq!(page.matches("nonce=\"0123abcd\"").count(), 2);
        for left in ["/*STYLE*/", "/*PROGRAM*/", "NONCE"] {
            assert!(!page.contains(left), "{left}");
        }
        for outside in ["http://", "https://", "//cdn", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        // What would end the program in the middle of the page.
        assert_eq!(page.matches("</script>").count(), 1);
        assert_eq!(page.matches("</style>").count(), 1);
    }
}
