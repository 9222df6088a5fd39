//! A recording in a browser: its time line.

use super::running::scene;
use super::visitor::Visitor;
use kinetoscope::RecordedFilm;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::record::{Film, Recording};
use kinetoscope::view::control::{Play, Speed};
use serde_json::json;
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Ends the showing, however it ends.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

#[test]
fn a_browser_seeks_in_a_recording_and_sees_where_things_were() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sim = scene(1);
    // The cube falls from 3 m, and a recording of half a second sees it nearly down.
    let cube = sim.rigid_object_id("cube").unwrap();
    sim.rigid_object_mut(cube).write_pose(&array![[0.7, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(100);
    sim.finish_recording(recorder).unwrap();
    drop(sim);

    let (film, mut sim) = Film::of(&Recording::open(&path).unwrap(), None).unwrap();
    let served = sim.serve_with("127.0.0.1:0", ServeCfg { speed: Some(Speed::REAL), ..ServeCfg::default() }).unwrap();
    let (address, over) = (served.address(), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let over = &over;
        scope.spawn(move || {
            let _ends = Ends(over);
            let stream = TcpStream::connect(address).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
            let (socket, _) = tungstenite::client(format!("ws://{address}/live"), stream).unwrap();
            let mut visitor = Visitor { socket };
            visitor.ask(json!({"do": "size", "width": 320, "height": 240}));
            visitor.ask(json!({"do": "pause"}));
            let height = |visitor: &mut Visitor, time: f64| {
                visitor.ask(json!({"do": "seek", "time": time}));
                let near = |now: f64| (now - time).abs() < 1e-6;
                let at = |state: &serde_json::Value| state["timeline"]["now"].as_f64().is_some_and(near);
                let state = visitor.wait_state("the time that was asked for", at);
                assert!(state["paused"].as_bool().unwrap() && near(state["time"].as_f64().unwrap()), "{state}");
                assert_eq!(
                    [&state["timeline"]["start"], &state["timeline"]["end"]].map(|x| x.as_f64().unwrap()),
                    [0.0, 0.5]
                );
                // The first picture may be of before; two that are the same are not. No turn at all has it drawn again.
                let mut last = f64::NAN;
                loop {
                    visitor.ask(json!({"do": "orbit", "dx": 0.0, "dy": 0.0}));
                    let picture = visitor.wait_picture("stage", |_, _| true);
                    let red = picture.enumerate_pixels().filter(|(.., p)| p[0] > 110 && p[1] < 70 && p[2] < 70);
                    let (sum, count) = red.fold((0.0, 0.0), |(sum, n), (_, y, _)| (sum + f64::from(y), n + 1.0));
                    let now = sum / f64::max(count, 1.0);
                    if (now - last).abs() < 0.1 {
                        return now;
                    }
                    last = now;
                }
            };
            // In half a second it falls 1.2 m: in the picture it is lower then, and not before.
            let begun = height(&mut visitor, 0.0);
            let ended = height(&mut visitor, 0.5);
            assert!(ended > begun + 10.0, "{begun} {ended}");
            let again = height(&mut visitor, 0.0);
            assert!((begun - again).abs() < 1.0, "{begun} {again}");
            visitor.ask(json!({"do": "play"}));
            visitor.wait_state("the end", |state| state["timeline"]["now"] == 0.5 && state["paused"] == true);
        });
        sim.play(&mut RecordedFilm(film), &mut || !over.load(Ordering::Acquire)).unwrap();
    });
    served.close(&mut sim).unwrap();
}
