//! Viewers that vanish leave nothing behind. Alone in its process, because it counts threads and files.

use kinetoscope::prelude::*;
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::Message;

/// Names of the threads of this process, without those of the test harness that come and go.
fn threads() -> Vec<String> {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
    let name = |path: std::path::PathBuf| std::fs::read_to_string(path.join("comm")).ok();
    tasks.filter_map(|task| name(task.path())).map(|name| name.trim().to_string()).collect()
}

/// Open files of this process.
fn files() -> usize {
    std::fs::read_dir("/proc/self/fd").unwrap().count()
}

fn settle(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(30), "{what}: threads {:?}, {} files", threads(), files());
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn twenty_abrupt_ends_leak_nothing_and_neither_does_the_end_of_the_simulation() {
    let bare = (threads().len(), files());
    let mut sim = SimulationManager::new(SimulationManagerCfg { threads: Some(1), ..Default::default() }).unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.2),
        mass: Some(1.0),
        init_pose: Pose::translation(0.0, 0.0, 0.5),
        ..Default::default()
    })
    .unwrap();
    let served = sim.serve("127.0.0.1:0").unwrap();
    sim.update(10);
    let before = (threads().len(), files());
    assert!(before.0 > bare.0 && before.1 > bare.1, "a server has a thread and a socket: {bare:?} and {before:?}");
    for k in 0..20 {
        let stream = TcpStream::connect(served.address()).unwrap();
        let (mut socket, _) = tungstenite::client(format!("ws://{}/live", served.address()), stream).unwrap();
        socket.send(Message::text(r#"{"do":"size","width":320,"height":180}"#)).unwrap();
        sim.update(5);
        // Some vanish at once, some in the middle of a picture.
        for _ in 0..k % 4 {
            let _ = socket.read();
        }
        if k == 7 {
            assert!(threads().len() > before.0 && files() > before.1, "a viewer has a thread and a socket");
        }
        // No goodbye: what was not read makes the system reset the connection.
        drop(socket);
    }
    settle("viewers are gone", || served.viewers() == 0);
    settle("as before the viewers", || (threads().len(), files()) == before);
    sim.update(10);

    // A viewer that is there when the simulation ends is sent away.
    let stream = TcpStream::connect(served.address()).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let (mut socket, _) = tungstenite::client(format!("ws://{}/live", served.address()), stream).unwrap();
    settle("it is there", || served.viewers() == 1);
    drop(sim);
    while socket.read().is_ok() {}
    drop(socket);
    settle("as before the simulation", || (threads().len(), files()) == bare);
    assert!(TcpStream::connect(served.address()).is_err(), "nobody listens any more");
}
