//! Events of the libraries: crate, level and fields of each, and their output by `RUST_LOG`.

use super::support::{ARM, CommandFolder};
use kinetoscope::prelude::*;
use kinetoscope::record::RecorderCfg;
use kinetoscope::viewer::{Closed, ServeCfg, WindowCfg};
use kinetoscope_testkit::events::{self, Collected, collected};
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{self, cfg, row, sim};
use kinetoscope_testkit::{process, wait, x_server};

/// The only event that `select` accepts.
#[track_caller]
fn only(select: impl Fn(&Collected) -> bool) -> Collected {
    let found = collected(select);
    assert_eq!(found.len(), 1, "{found:?}");
    found.into_iter().next().unwrap()
}

#[track_caller]
fn check(event: &Collected, target: &str, level: &str, fields: &[(&str, &str)]) {
    assert_eq!((event.target, event.level.as_str()), (target, level), "{event:?}");
    for (name, value) in fields {
        assert_eq!(event.fields.get(name).map(String::as_str), Some(*value), "{name}: {event:?}");
    }
}

/// Each diagnostic is one event, also after entities are added, which compiles the earlier ones again.
#[test]
fn diagnostics() {
    events::start();
    let files = TempFiles::default();
    let mut sim = sim(cfg(1, 1));
    let unlimited = ARM.replace("effort=\"50\"", "effort=\"0\"");
    sim.add_robot(worlds::text_robot(&files, "events_unlimited", &unlimited)).unwrap();
    sim.add_rigid_object(worlds::ball("ball", 0.1, 1.0, [1.0, 0.0, 1.0])).unwrap();
    assert_eq!(sim.diagnostics().len(), 1, "{:?}", sim.diagnostics());
    let event = only(|event| event.message.contains("events_unlimited.urdf"));
    check(&event, "kinetoscope_sim", "WARN", &[("kind", "effort-unlimited")]);
    assert_eq!(event.message, sim.diagnostics()[0].to_string());
}

/// One event for an environment that diverges, with its index; none while it stays frozen, and another one after a reset.
#[test]
fn divergence() {
    events::start();
    let mut sim = sim(cfg(98, 2));
    let ball = sim.add_rigid_object(worlds::ball("ball", 0.1, 1.0, [0.0, 0.0, 5.0])).unwrap();
    let fast = row([1e12, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let of_env_97 = |event: &Collected| {
        event.message == "an environment diverged" && event.fields.get("env").is_some_and(|env| env == "97")
    };
    sim.update(2);
    assert!(collected(of_env_97).is_empty());
    for times in 1..3 {
        sim.rigid_object_mut(ball).write_velocity(&fast, Some(&[EnvId(97)])).unwrap();
        sim.update(5);
        assert_eq!(sim.diverged().len(), 1);
        let events = collected(of_env_97);
        assert_eq!(events.len(), times, "{events:?}");
        let reason = events[times - 1].fields["reason"].clone();
        assert_eq!(sim.diverged()[0].reason, reason);
        check(&events[times - 1], "kinetoscope_sim", "WARN", &[("env", "97")]);
        sim.reset(None).unwrap();
    }
}

/// Buffers of MuJoCo that were too small: an event for each growth. The text of MuJoCo's own warning is for debugging.
///
/// The growths are counted in a process of their own. Root cause of a wrong count: environment 0 of other tests, which
/// run in parallel in one process, emits the same events.
#[test]
fn grown_buffers() {
    process::assert_passes(module_path!(), "grown_buffers_scenario", &[]);
}

#[test]
#[ignore = "runs in a process of its own"]
fn grown_buffers_scenario() {
    if !process::is_child() {
        return;
    }
    events::start();
    let mut sim = sim(cfg(1, 1));
    for i in 0..60 {
        let [x, y] = [f64::from(i % 8), f64::from(i / 8)].map(|k| 0.3 * k);
        sim.add_rigid_object(worlds::cube(&format!("cube{i}"), 0.2, 1.0, [x, y, 0.15])).unwrap();
    }
    // The cubes land after 0.1 s.
    sim.update(15);
    let growths = sim.warnings().buffer_growths();
    let events = collected(|event| event.message == "a buffer of MuJoCo was doubled");
    assert!(growths > 0 && events.len() as u64 == growths, "{growths} {events:?}");
    for event in &events {
        check(event, "kinetoscope_sim", "INFO", &[("env", "0")]);
        assert!(["what", "bytes"].iter().all(|field| event.fields.contains_key(field)), "{event:?}");
    }
}

/// A recorder that cannot follow: choosing the colors of a GIF takes longer than drawing an empty scene.
#[test]
fn slow_recorder() {
    events::start();
    let folder = TempFiles::default();
    let mut sim = sim(cfg(1, 1));
    let images = worlds::camera([640, 480], [2.0, 0.0, 1.0], [0.0; 3], Channels { color: true, ..Channels::NONE });
    sim.add_sensor("camera", images).unwrap();
    let path = folder.folder().join("slow_recorder.gif");
    let recorder = sim.record(RecorderCfg { packets: 2, ..RecorderCfg::new(&path) }).unwrap();
    sim.update(20);
    let summary = sim.finish_recording(recorder).unwrap();
    assert!(summary.waits > 0, "the recorder was fast enough: {summary}");
    let events = collected(|event| event.fields.get("path").is_some_and(|path| path.ends_with("slow_recorder.gif")));
    // The first wait, the second, the fourth, ...
    let expected = 1 + summary.waits.ilog2() as usize;
    assert_eq!(events.len(), expected, "{} waits: {events:?}", summary.waits);
    check(&events[0], "kinetoscope_record", "WARN", &[("waits", "1")]);
}

/// The address of a view, without its token.
#[test]
fn served_address() {
    events::start();
    let mut sim = sim(cfg(1, 1));
    for (address, has_token) in [("127.0.0.1:0", "false"), ("0.0.0.0:0", "true")] {
        let served = sim.serve_with(address, ServeCfg::default()).unwrap();
        let at = served.address().to_string();
        let event = only(|event| event.fields.get("address") == Some(&at));
        check(&event, "kinetoscope_viewer", "INFO", &[("has_token", has_token)]);
        let token = served.url().split_once("token=").map_or("no token", |(_, token)| token);
        assert!(!format!("{event:?}").contains(token), "{event:?}");
    }
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn lost_display() {
    events::start();
    let mut display = x_server::Display::start("640x480");
    let mut sim = sim(cfg(1, 1));
    let display_name = Some(display.name.clone());
    let window = sim.open_window_with(WindowCfg { display: display_name, ..WindowCfg::default() }).unwrap();
    display.server.kill().unwrap();
    wait::until("the window ends", || !window.is_open());
    let Some(Closed::DisplayLost(reason)) = window.closed() else { panic!("{:?}", window.closed()) };
    let event = only(|event| event.fields.get("reason") == Some(&reason));
    check(&event, "kinetoscope_viewer", "WARN", &[]);
}

/// `RUST_LOG` selects events by crate and level. Without it, the command prints what it printed before.
#[test]
fn rust_log() {
    let shell = CommandFolder::with(&[("arm.urdf", &ARM.replace("effort=\"50\"", "effort=\"0\""))]);
    let stderr = |filter: Option<&str>| {
        let mut command = shell.command("check arm.urdf");
        command.env_remove("RUST_LOG");
        if let Some(filter) = filter {
            command.env("RUST_LOG", filter);
        }
        let out = command.output().unwrap();
        assert_eq!(out.status.code(), Some(1));
        String::from_utf8(out.stderr).unwrap()
    };
    let plain = stderr(None);
    assert!(!plain.contains("kinetoscope_sim"), "{plain}");
    for (filter, prints) in [
        ("warn", true),
        ("kinetoscope_sim=warn", true),
        ("kinetoscope_sim=error", false),
        ("kinetoscope_record=trace", false),
        ("off", false),
    ] {
        let text = stderr(Some(filter));
        assert_eq!(text.contains("WARN kinetoscope_sim: "), prints, "{filter}: {text}");
        assert!(text.contains("kind=\"effort-unlimited\"") == prints && text.ends_with(&plain), "{filter}: {text}");
    }
    // An invalid filter is reported and does not end the command.
    let text = stderr(Some("kinetoscope_sim=loud"));
    assert!(text.starts_with("warning: RUST_LOG: ") && text.ends_with(&plain), "{text}");
}
