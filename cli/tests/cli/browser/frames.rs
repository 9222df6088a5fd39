//! The view in a frame of another page, as in notebooks.

use super::super::serve::running::ServedSimulation;
use super::{browser, chromium::Tab};
use kinetoscope::viewer::ServeCfg;
use kinetoscope_testkit::wait;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::time::Duration;

/// Serves a page with a frame that shows `url`, at a port of its own, until the test ends.
fn page_with_frame(url: &str) -> SocketAddr {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap();
    let page = format!("<!doctype html><p id='link'></p><iframe src='{url}' width='900' height='600'></iframe>");
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let _ = stream.read(&mut [0; 4096]);
            let length = page.len();
            let _ = write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{page}"
            );
        }
    });
    address
}

/// Number of pixels of the page that are as red as the cube.
fn red_pixels(tab: &mut Tab<'_>) -> usize {
    let image = image::load_from_memory(&tab.screenshot()).unwrap().to_rgb8();
    image
        .pixels()
        .filter(|pixel| pixel[0] > 60 && f64::from(pixel[0]) > 2.5 * f64::from(pixel[1].max(pixel[2])))
        .count()
}

fn is_refused(tab: &mut Tab<'_>) -> bool {
    tab.console_errors().iter().any(|error| error.contains("frame-ancestors"))
}

/// Root cause: browsers did not show `sim.show()` of a notebook, because the page forbade all frames.
#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn pages_of_this_machine_show_the_view() {
    let browser = browser();
    let cfg = ServeCfg { allow_local_frames: true, ..ServeCfg::default() };
    let allowed = ServedSimulation::start_at(1, "127.0.0.1:0", cfg);
    let forbidden = ServedSimulation::start(1);
    let outer = page_with_frame(&allowed.url);
    for name in ["localhost", "127.0.0.1"] {
        let mut tab = browser.open(&format!("http://{name}:{}/", outer.port()));
        wait::until("the view connects", || allowed.viewers() == 1);
        wait::until("the cube", || red_pixels(&mut tab) > 50);
        assert!(!is_refused(&mut tab), "{name}");
        tab.evaluate("document.querySelector('iframe').remove()");
        wait::until("the view is gone", || allowed.viewers() == 0);
    }
    // Controls: a website whose name resolves to this machine, and a view that allows no frames.
    for (host, url) in [("site.localhost", &allowed.url), ("localhost", &forbidden.url)] {
        let outer = page_with_frame(url);
        let mut tab = browser.open(&format!("http://{host}:{}/", outer.port()));
        wait::until("the refusal", || is_refused(&mut tab));
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!((allowed.viewers(), forbidden.viewers(), red_pixels(&mut tab)), (0, 0, 0), "{host}");
    }
}
