//! Tests of live streams with a client that speaks Foxglove's protocol, version `foxglove.sdk.v1`. The MCAP file of the same
//! simulation is the reference.

use super::*;
use crate::Record;
use crate::packet::Packet;
use crate::stream::StreamSchema;
use crate::tests::{EnvId, ObjectShape, RayCasterCfg, World, messages, scratch};
use crate::writer::{FormatWriter, WriteResult};
use kinetoscope_sensors::ContactSensorCfg;
use kinetoscope_sensors::ray::pattern::Grid;
use kinetoscope_testkit::worlds::{cfg, fixed, object, sim};
use kinetoscope_testkit::{events, wait};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::net::TcpStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;
use tungstenite::client::IntoClientRequest as _;
use tungstenite::http::HeaderValue;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// First bytes of binary messages.
const MESSAGE: u8 = 1;
const TIME: u8 = 2;

/// Messages of a server.
#[derive(Debug)]
enum Received {
    Text(Value),
    Message { subscription: usize, nanos: u64, data: Vec<u8> },
    Time(u64),
}

/// A client, which reads on a thread of its own.
struct Client {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    /// Channels as the server advertised them.
    channels: Vec<Value>,
}

fn any_port() -> FoxgloveCfg {
    FoxgloveCfg::at("0").unwrap()
}

/// Connects and reads the channels, of which the server has `count`.
fn connect(server: &FoxgloveServer, count: usize) -> Client {
    let mut request = server.url().into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static("foxglove.sdk.v1"));
    let (mut socket, answer) = tungstenite::connect(request).unwrap();
    assert_eq!(answer.headers()["sec-websocket-protocol"], "foxglove.sdk.v1");
    let mut channels = Vec::new();
    while channels.len() < count {
        if let Received::Text(text) = received(socket.read().unwrap())
            && text["op"] == "advertise"
        {
            channels.extend(text["channels"].as_array().unwrap().iter().cloned());
        }
    }
    Client { socket, channels }
}

fn received(message: Message) -> Received {
    match message {
        Message::Text(text) => Received::Text(serde_json::from_str(&text).unwrap()),
        Message::Binary(bytes) => {
            let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
            match bytes[0] {
                MESSAGE => {
                    let subscription = u32::from_le_bytes(bytes[1..5].try_into().unwrap()) as usize;
                    Received::Message { subscription, nanos: number(5), data: bytes[13..].to_vec() }
                }
                TIME => Received::Time(number(1)),
                other => panic!("unknown operation {other}"),
            }
        }
        other => panic!("{other:?}"),
    }
}

impl Client {
    /// Subscribes to all channels; the number of a subscription is the index of its channel.
    fn subscribe(&mut self) {
        let subscriptions: Vec<Value> =
            self.channels.iter().enumerate().map(|(k, one)| json!({"id": k, "channelId": one["id"]})).collect();
        let text = json!({"op": "subscribe", "subscriptions": subscriptions}).to_string();
        self.socket.send(Message::text(text)).unwrap();
    }

    /// Reads on a thread until the server disconnects.
    fn read(mut self) -> (Vec<Value>, Receiver<Received>) {
        let (to, from) = channel();
        thread::spawn(move || {
            while let Ok(message) = self.socket.read() {
                if message.is_close() || to.send(received(message)).is_err() {
                    break;
                }
            }
        });
        (self.channels, from)
    }
}

/// A simulation with every kind of sensor that a stream treats differently.
fn world() -> World {
    let mut world = World::new(2, 2);
    let pattern = Grid { resolution: 0.2, size: [0.4, 0.2], ..Grid::default() };
    let scanner = RayCasterCfg { pattern: pattern.into(), ..RayCasterCfg::default() };
    world.sim.add_sensor("scanner", scanner).unwrap();
    world.sim.add_sensor("touch", ContactSensorCfg::for_bodies("cube")).unwrap();
    // The stream does not begin at time 0.
    world.sim.update(3);
    world
}

/// Topic, schema, encodings and metadata of the channels of a file.
fn channels_of(path: &std::path::Path) -> BTreeMap<String, Value> {
    let bytes = std::fs::read(path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let about = |channel: &mcap::Channel<'_>| {
        let schema = channel.schema.as_ref().unwrap();
        let text = String::from_utf8(schema.data.to_vec()).unwrap();
        json!({
            "encoding": channel.message_encoding, "schemaName": schema.name, "schemaEncoding": schema.encoding,
            "schema": text, "metadata": channel.metadata,
        })
    };
    summary.channels.values().map(|channel| (channel.topic.clone(), about(channel))).collect()
}

/// Number of topics of a simulation, by a recording of its present state.
fn topic_count(sim: &mut SimulationManager) -> usize {
    let (_folder, path) = scratch("now.mcap");
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.finish_recording(recorder).unwrap();
    channels_of(&path).len()
}

#[test]
fn same_messages_as_a_recording() {
    let (_folder, path) = scratch("run.mcap");
    let mut world = world();
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    let server = world.sim.stream_to_foxglove(any_port()).unwrap();
    assert!(server.address().ip().is_loopback());
    let count = topic_count(&mut world.sim);
    let mut client = connect(&server, count);
    client.subscribe();
    let (channels, from) = client.read();
    let topic = |k: usize| channels[k]["topic"].as_str().unwrap().to_string();
    let mut got = Vec::<(String, u64, Vec<u8>)>::new();
    let mut times = Vec::<u64>::new();
    let mut topics = BTreeSet::new();
    let mut step = 0;
    while topics.len() < count {
        assert!(
            step < 2000,
            "nothing came of {:?}",
            (0..count).map(topic).filter(|t| !topics.contains(t)).collect::<Vec<_>>()
        );
        world.step(step);
        step += 1;
        if step % 50 == 0 {
            world.sim.reset(Some(&[EnvId(1)])).unwrap();
        }
        loop {
            match from.recv_timeout(Duration::from_millis(2)) {
                Ok(Received::Message { subscription, nanos, data }) => {
                    topics.insert(topic(subscription));
                    got.push((topic(subscription), nanos, data));
                }
                Ok(Received::Time(nanos)) => times.push(nanos),
                Ok(Received::Text(text)) => panic!("{text}"),
                Err(RecvTimeoutError::Timeout) => break,
                Err(RecvTimeoutError::Disconnected) => panic!("the server disconnected"),
            }
        }
    }
    server.close(&mut world.sim).unwrap();
    world.sim.finish_recording(recorder).unwrap();

    let expected = channels_of(&path);
    let advertised: BTreeMap<String, Value> = channels
        .iter()
        .map(|channel| {
            let mut about = channel.clone();
            about["metadata"] = json!(about.get("metadata").cloned().unwrap_or(json!({})));
            let fields = about.as_object_mut().unwrap();
            fields.remove("id");
            let topic = fields.remove("topic").unwrap();
            (topic.as_str().unwrap().to_string(), about)
        })
        .collect();
    assert_eq!(advertised, expected);
    let recorded: BTreeSet<(String, u64, Vec<u8>)> =
        messages(&path).into_iter().map(|message| (message.topic, message.time, message.data)).collect();
    for message in &got {
        assert!(recorded.contains(message), "{} at {} ns is not in the file", message.0, message.1);
    }
    // The time of the stream does not run ahead of its messages.
    let last = recorded.iter().map(|(_, nanos, _)| *nanos).max().unwrap();
    assert!(!times.is_empty() && times.is_sorted() && times.iter().all(|time| *time <= last), "{times:?}");
}

/// A client that connects later gets the origins of environments and the scene, which were sent before, and those that
/// replaced them.
#[test]
fn later_client() {
    let mut sim = sim(cfg(1, 1));
    let cube = kinetoscope_testkit::worlds::cube("cube", 0.1, 1.0, [0.0, 0.0, 1.0]);
    sim.add_rigid_object(cube).unwrap();
    let server = sim.stream_to_foxglove(any_port()).unwrap();
    sim.update(20);
    // /events, /tf_static, /env_0/tf, /env_0/scene.
    for expected in [1, 2] {
        let mut client = connect(&server, 4);
        client.subscribe();
        let (channels, from) = client.read();
        let mut first = BTreeMap::new();
        while first.len() < 2 {
            match from.recv_timeout(Duration::from_secs(20)) {
                Ok(Received::Message { subscription, data, .. }) => {
                    first.insert(channels[subscription]["topic"].as_str().unwrap().to_string(), data);
                }
                Ok(Received::Time(_)) => {}
                other => panic!("{other:?}"),
            }
        }
        let scene = String::from_utf8_lossy(&first["/env_0/scene"]).into_owned();
        assert!(first.contains_key("/tf_static") && scene.contains("cube"), "{scene}");
        assert_eq!(scene.contains("table"), expected == 2, "{scene}");
        if expected == 1 {
            // Changes while this client is connected, so that the stream is not paused.
            sim.add_rigid_object(fixed(object("table", ObjectShape::cube(0.2), [1.0, -1.0, 0.5]))).unwrap();
            wait::until("the new scene is sent", || {
                sim.update(1);
                from.try_iter().any(|one| match one {
                    Received::Message { data, .. } => String::from_utf8_lossy(&data).contains("table"),
                    _ => false,
                })
            });
        }
    }
}

/// Without clients nothing is recorded. A client that does not read delays nothing, and closing disconnects it.
#[test]
fn no_reader() {
    let mut world = world();
    let server = world.sim.stream_to_foxglove(any_port()).unwrap();
    let rows = |sim: &SimulationManager| sim.observers().get(server.observer).unwrap().recorder.summary().packets;
    (0..30).for_each(|step| world.step(step));
    assert_eq!((rows(&world.sim), server.clients()), (1, 0), "the initial state only");
    let mut client = connect(&server, topic_count(&mut world.sim));
    client.subscribe();
    (0..300).for_each(|step| world.step(step));
    assert!(rows(&world.sim) > 1 && server.clients() == 1);
    let observer = world.sim.observers().get(server.observer).unwrap();
    assert_eq!(observer.recorder.summary().waits, 0);
    let sent = rows(&world.sim) + server.dropped_rows(&world.sim).unwrap();
    assert!(sent > 290, "{sent} of 300 rows");
    server.close(&mut world.sim).unwrap();
    wait::until("the server disconnects", || client.socket.read().is_err());
    assert_eq!(server.clients(), 0);
    assert!(server.close(&mut world.sim).is_err() && server.dropped_rows(&world.sim).is_err());
    assert!(TcpStream::connect(server.address()).is_err(), "the server does not listen");
}

/// A writer that is as slow as a test wants: it writes once the sender is gone.
struct BlockedWriter(Receiver<()>);

impl FormatWriter for BlockedWriter {
    fn write(&mut self, _streams: &[StreamSchema], _packet: &Packet) -> WriteResult {
        let _ = self.0.recv();
        Ok(())
    }

    fn finish(&mut self, _streams: &[StreamSchema]) -> WriteResult<u64> {
        Ok(0)
    }

    fn partial_path(&self) -> Option<PathBuf> {
        None
    }
}

/// A stream whose writer is too slow drops rows and waits for nothing; the first drop, the second, the fourth and so on are
/// events.
#[test]
fn dropped_rows() {
    events::start();
    let mut sim = sim(cfg(1, 1));
    sim.add_rigid_object(object("cube", ObjectShape::cube(0.2), [0.0, 0.0, 0.1])).unwrap();
    let (end, blocked) = channel();
    let cfg = RecorderCfg { path: "dropped_rows".into(), packets: 2, ..RecorderCfg::default() };
    let recorder = Recorder::start_live(&mut sim, cfg, |_, _, _| Ok(Box::new(BlockedWriter(blocked)))).unwrap();
    let observer = sim.observers_mut().add(recorder);
    // The state at the start and one row fill the packets.
    for (steps, dropped) in [(1, 0), (1, 1), (18, 19)] {
        sim.update(steps);
        let recorder = sim.observers().get(observer).unwrap();
        assert_eq!((recorder.dropped_rows(), recorder.summary().waits), (dropped, 0));
    }
    let drops = events::collected(|event| event.fields.get("path").is_some_and(|path| path == "dropped_rows"));
    let counts: Vec<&str> = drops.iter().map(|event| event.fields["dropped_rows"].as_str()).collect();
    assert_eq!(counts, ["1", "2", "4", "8", "16"]);
    assert!(drops.iter().all(|event| (event.target, event.level.as_str()) == ("kinetoscope_record", "WARN")));
    drop(end);
}

/// Regression: a stream that an error had stopped kept its clients, which saw a robot that never moved again, and no
/// caller learned of the error.
#[test]
fn failed_stream() {
    let mut world = World::new(1, 1);
    let server = world.sim.stream_to_foxglove(any_port()).unwrap();
    let mut client = connect(&server, topic_count(&mut world.sim));
    client.subscribe();
    world.step(0);
    assert_eq!(server.failure(&world.sim).unwrap(), None);
    // A second robot adds joints, which the sensor of all joints now measures.
    world.sim.add_robot(kinetoscope_testkit::worlds::sr5("other")).unwrap();
    (1..20).for_each(|step| world.step(step));
    let reason = server.failure(&world.sim).unwrap().unwrap();
    assert!(reason.contains("joints"), "{reason}");
    assert_eq!(server.clients(), 0, "the server ends the connections");
    wait::until("the server disconnects", || client.socket.read().is_err());
    let error = server.close(&mut world.sim).unwrap_err().to_string();
    assert!(error.contains("joints"), "{error}");
}

/// Response to the request of a client with further headers, at an address of the server.
fn response(address: SocketAddr, path: &str, headers: &[(&'static str, &str)]) -> u16 {
    let mut request = format!("ws://{address}{path}").into_client_request().unwrap();
    let protocol = ("Sec-WebSocket-Protocol", "foxglove.sdk.v1");
    for &(name, value) in [protocol].iter().chain(headers) {
        request.headers_mut().insert(name, HeaderValue::from_str(value).unwrap());
    }
    match tungstenite::connect(request) {
        Ok((_, response)) => response.status().as_u16(),
        Err(tungstenite::Error::Http(response)) => response.status().as_u16(),
        Err(error) => panic!("{error}"),
    }
}

/// Pages of other websites cannot read the stream: not from their own address, and not by a host name of their own that
/// leads to this machine.
#[test]
fn websites() {
    let mut sim = sim(cfg(1, 1));
    let topics = vec![Topic::Events];
    let mut start = |websites: &[&str]| {
        let websites = websites.iter().map(ToString::to_string).collect();
        let server = sim.stream_to_foxglove(FoxgloveCfg { websites, topics: topics.clone(), ..any_port() });
        server.map(|server| server.address())
    };
    let default: Vec<String> = FoxgloveCfg::default().websites;
    let named = start(&default.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
    let [none, other] = [&[][..], &["http://localhost:3000"]].map(|websites| start(websites).unwrap());
    for (origin, by_default, without, by_other) in [
        ("https://app.foxglove.dev", 101, 403, 403),
        ("http://localhost:3000", 403, 403, 101),
        ("https://example.org", 403, 403, 403),
        ("null", 403, 403, 403),
        ("file://", 101, 101, 101),
    ] {
        let got = [named, none, other].map(|address| response(address, "", &[("Origin", origin)]));
        assert_eq!(got, [by_default, without, by_other], "{origin}");
    }
    for (host, status) in [("localhost:8765", 101), ("example.org:8765", 403)] {
        assert_eq!(response(named, "", &[("Host", host)]), status, "{host}");
    }
    let error = start(&["app.foxglove.dev"]).unwrap_err().to_string();
    assert!(error.contains("\"app.foxglove.dev\" is no origin"), "{error}");
}

/// Other machines need the token.
#[test]
fn token() {
    let mut sim = sim(cfg(1, 1));
    let at = FoxgloveCfg { topics: vec![Topic::Events], ..FoxgloveCfg::at("0.0.0.0:0").unwrap() };
    let server = sim.stream_to_foxglove(at).unwrap();
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, server.address().port()));
    let token = server.url().split_once("/?token=").unwrap().1.to_string();
    assert_eq!(token.len(), 32);
    for (path, status) in [
        (String::new(), 403),
        ("/?token=".into(), 403),
        (format!("/?token={}", &token[1..]), 403),
        (format!("/?token={token}"), 101),
    ] {
        assert_eq!(response(address, &path, &[]), status, "{path}");
    }
    let page = [("Origin", "https://example.org")];
    assert_eq!(response(address, &format!("/?token={token}"), &page), 403, "a website that knows the token");
    // Loopback addresses need none.
    let local = sim.stream_to_foxglove(FoxgloveCfg { topics: vec![Topic::Events], ..any_port() }).unwrap();
    assert_eq!(local.url(), format!("ws://{}", local.address()));
}

/// Connections that send nothing, something else or too much get no stream, and do not keep others from connecting.
#[test]
fn other_requests() {
    use std::io::{Read as _, Write as _};
    let mut sim = sim(cfg(1, 1));
    let server = sim.stream_to_foxglove(FoxgloveCfg { topics: vec![Topic::Events], ..any_port() }).unwrap();
    let _silent: Vec<TcpStream> = (0..20).map(|_| TcpStream::connect(server.address()).unwrap()).collect();
    let long = format!("GET / HTTP/1.1\r\nHost: localhost\r\nCookie: {}", "a".repeat(1 << 14));
    for (request, status) in [
        ("SSH-2.0-OpenSSH_9.2\r\n\r\n", "400"),
        ("GET / HTTP/1.1\r\n\r\n", "400"),
        ("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "426"),
        (long.as_str(), "431"),
    ] {
        let mut stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut response = Vec::new();
        let _ = stream.read_to_end(&mut response);
        let response = String::from_utf8_lossy(&response).into_owned();
        assert!(response.starts_with(&format!("HTTP/1.1 {status}")), "{request:.40}: {response}");
    }
    assert_eq!(response(server.address(), "", &[]), 101);
}

#[test]
fn errors() {
    let mut sim = sim(cfg(1, 1));
    let server = sim.stream_to_foxglove(FoxgloveCfg { topics: vec![Topic::Events], ..any_port() }).unwrap();
    let again = FoxgloveCfg { address: server.address(), topics: vec![Topic::Events], ..FoxgloveCfg::default() };
    let error = sim.stream_to_foxglove(again).unwrap_err();
    assert!(error.to_string().contains(&format!("port {} is in use", server.address().port())), "{error}");
    for (topics, period_steps, text) in [
        (vec![Topic::JointStates("arm".into())], 1, "arm"),
        (vec![Topic::Everything], 1, "nothing to record"),
        (vec![Topic::Events], 0, "period_steps"),
    ] {
        let cfg = FoxgloveCfg { topics, period_steps, ..any_port() };
        let error = sim.stream_to_foxglove(cfg).unwrap_err().to_string();
        assert!(error.contains(text), "{error}");
    }
}

#[test]
fn addresses() {
    for (text, address) in [
        ("8765", "127.0.0.1:8765"),
        ("localhost:9000", "127.0.0.1:9000"),
        ("0.0.0.0", "0.0.0.0:8765"),
        (" 10.0.0.1:80 ", "10.0.0.1:80"),
        ("::1", "[::1]:8765"),
        ("[::1]:1", "[::1]:1"),
    ] {
        assert_eq!(FoxgloveCfg::at(text).unwrap().address.to_string(), address, "{text}");
    }
    for text in ["port", "65536", "robot:80", "127.0.0.1:", "-1"] {
        let error = FoxgloveCfg::at(text).unwrap_err();
        assert!(error.to_string().contains(&format!("{text:?}")), "{error}");
    }
    let text = serde_json::to_string(&FoxgloveCfg::default()).unwrap();
    assert_eq!(serde_json::from_str::<FoxgloveCfg>(&text).unwrap(), FoxgloveCfg::default());
}
