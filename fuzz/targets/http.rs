//! Heads of HTTP requests, and the decision about their origin and token.
#![no_main]

use kinetoscope_http::{AccessPolicy, RequestHead};
use std::net::SocketAddr;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(Some(head)) = RequestHead::parse(bytes) else { return };
    assert!(head.rest.len() < bytes.len() && !head.method.is_empty());
    assert_eq!(
        RequestHead::parse(&bytes[..bytes.len() - head.rest.len()]).ok().flatten().map(|again| again.path),
        Some(head.path.clone())
    );
    let local = AccessPolicy::new(SocketAddr::from(([127, 0, 0, 1], 80)), None);
    if local.check(&head).is_ok() {
        let host = head.header("host").ok().flatten().expect("an accepted request names its host");
        assert!(
            ["localhost", "127.", "[", "::"].iter().any(|start| host.to_ascii_lowercase().starts_with(start)),
            "{host}"
        );
    }
    let websites = local.with_websites(vec!["https://app.example.org".into()]).expect("an origin");
    let _ = websites.check(&head);
    let _ = (head.query("token"), head.header_contains("connection", "upgrade"));
});
