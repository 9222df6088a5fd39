//! Headless Chromium, driven by its DevTools protocol: JSON over one WebSocket.

use kinetoscope_testkit::wait;
use serde_json::{Value, json};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

/// Longest wait on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(90);

/// A browser with an empty profile. Dropping the value ends the browser.
pub(crate) struct Chromium {
    process: Child,
    wire: Mutex<DevTools>,
    _profile: TempDir,
    _alone: MutexGuard<'static, ()>,
}

/// Serializes the browser tests: a machine with two cores already renders, steps and displays in each test.
static BROWSER_LOCK: Mutex<()> = Mutex::new(());

struct DevTools {
    socket: WebSocket<TcpStream>,
    next: u64,
    /// Events received while waiting for responses.
    events: Vec<Value>,
}

impl Chromium {
    pub(crate) fn start(program: &Path) -> Self {
        let alone = BROWSER_LOCK.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().unwrap();
        // The sandbox does not work for root, nor in most containers. The only opened page is our own.
        let process = Command::new(program)
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-extensions", "--mute-audio", "--hide-scrollbars"])
            .args(["--remote-debugging-port=0", "--window-size=1400,900"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .arg("about:blank")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Chromium writes its port and the path of its WebSocket to this file.
        let file = profile.path().join("DevToolsActivePort");
        let (port, path) = wait::until_some("Chromium", || {
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            text.trim().split_once('\n').map(|(port, path)| (port.parse::<u16>().unwrap(), path.trim().to_string()))
        });
        let stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
        stream.set_read_timeout(Some(TIMEOUT)).unwrap();
        let (socket, _) = tungstenite::client(format!("ws://127.0.0.1:{port}{path}"), stream).unwrap();
        let wire = Mutex::new(DevTools { socket, next: 0, events: Vec::new() });
        Self { process, wire, _profile: profile, _alone: alone }
    }

    fn wire(&self) -> MutexGuard<'_, DevTools> {
        self.wire.lock().unwrap()
    }

    /// Opens a page and defines the functions of [`super::TOOLS`] in it.
    pub(crate) fn open(&self, url: &str) -> Tab<'_> {
        let target = self.wire().request(None, "Target.createTarget", json!({"url": "about:blank"}));
        let attach = json!({"targetId": target["targetId"], "flatten": true});
        let session =
            self.wire().request(None, "Target.attachToTarget", attach)["sessionId"].as_str().unwrap().to_string();
        let mut tab = Tab { browser: self, session };
        for domain in ["Page.enable", "Runtime.enable", "Log.enable"] {
            tab.ask(domain, json!({}));
        }
        tab.ask("Page.addScriptToEvaluateOnNewDocument", json!({"source": super::TOOLS}));
        tab.ask("Page.navigate", json!({"url": url}));
        tab.wait_until("the page", "document.readyState === 'complete' && $('link') !== null");
        tab
    }
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // The close request also ends the helper processes.
        if let Ok(mut wire) = self.wire.lock() {
            let _ = wire.socket.send(Message::text(json!({"id": 0, "method": "Browser.close"}).to_string()));
        }
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(5) {
            if matches!(self.process.try_wait(), Ok(Some(_))) {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl DevTools {
    /// Sends a request and waits for the response.
    fn request(&mut self, session: Option<&str>, method: &str, params: Value) -> Value {
        self.next += 1;
        let mut message = json!({"id": self.next, "method": method, "params": params});
        if let Some(session) = session {
            message["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(message.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else { continue };
            let message: Value = serde_json::from_str(&text).unwrap();
            if message["id"] == self.next {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].clone();
            }
            self.events.push(message);
        }
    }
}

/// A page of the browser.
pub(crate) struct Tab<'a> {
    browser: &'a Chromium,
    session: String,
}

impl Tab<'_> {
    fn ask(&mut self, method: &str, params: Value) -> Value {
        self.browser.wire().request(Some(&self.session), method, params)
    }

    /// Evaluates an expression in the page.
    pub(crate) fn evaluate(&mut self, expression: &str) -> Value {
        let params = json!({"expression": expression, "returnByValue": true, "awaitPromise": true});
        let answer = self.ask("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].clone()
    }

    /// Evaluates an expression that is a number.
    pub(crate) fn number(&mut self, expression: &str) -> f64 {
        self.evaluate(expression).as_f64().unwrap()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub(crate) fn wait_until(&mut self, what: &str, expression: &str) {
        let start = Instant::now();
        // While the page loads, elements may not exist yet.
        let wanted = format!("(() => {{ try {{ return {expression}; }} catch {{ return false; }} }})()");
        while self.evaluate(&wanted) != true {
            assert!(start.elapsed() < TIMEOUT, "waited for {what}: {:?}", self.console_errors());
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Scrolls an element into view. Returns its left edge, vertical center, width and height \[CSS pixels\].
    pub(crate) fn rectangle(&mut self, element: &str) -> [f64; 4] {
        let rectangle = self.evaluate(&format!(
            "(() => {{ const e = {element}; e.scrollIntoView({{ block: 'center', behavior: 'instant' }}); \
             const r = e.getBoundingClientRect(); return [r.left, r.top + r.height / 2, r.width, r.height]; }})()"
        ));
        [0, 1, 2, 3].map(|k| rectangle[k].as_f64().unwrap())
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], pressed: bool, ctrl: bool) {
        let (buttons, modifiers) = (u8::from(pressed), 2 * u8::from(ctrl));
        let params = json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1,
                            "modifiers": modifiers});
        self.ask("Input.dispatchMouseEvent", params);
    }

    /// Clicks on the center of an element.
    pub(crate) fn click(&mut self, element: &str) {
        let [x, y, width, _] = self.rectangle(element);
        self.drag([x + 0.5 * width, y], [x + 0.5 * width, y]);
    }

    /// Drags with the left mouse button.
    pub(crate) fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        self.hold(from, to, false);
        self.release(to);
    }

    /// Drags without releasing the button, with or without Ctrl.
    pub(crate) fn hold(&mut self, from: [f64; 2], to: [f64; 2], ctrl: bool) {
        self.mouse("mouseMoved", from, false, ctrl);
        self.mouse("mousePressed", from, true, ctrl);
        for k in 1..=5 {
            let part = f64::from(k) / 5.0;
            self.mouse("mouseMoved", [0, 1].map(|i| from[i] + part * (to[i] - from[i])), true, ctrl);
        }
    }

    pub(crate) fn release(&mut self, at: [f64; 2]) {
        self.mouse("mouseReleased", at, false, false);
    }

    /// Selects an option of a list.
    pub(crate) fn choose(&mut self, id: &str, value: &str) {
        self.evaluate(&format!("$('{id}').value = '{value}'; $('{id}').dispatchEvent(new Event('change'))"));
    }

    /// Sets the color scheme and the window size \[CSS pixels\].
    pub(crate) fn show_as(&mut self, scheme: &str, [width, height]: [u32; 2]) {
        let feature = json!({"features": [{"name": "prefers-color-scheme", "value": scheme}]});
        self.ask("Emulation.setEmulatedMedia", feature);
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.ask("Emulation.setDeviceMetricsOverride", size);
    }

    /// Returns the visible part of the page as PNG.
    pub(crate) fn screenshot(&mut self) -> Vec<u8> {
        let answer = self.ask("Page.captureScreenshot", json!({"format": "png"}));
        decode_base64(answer["data"].as_str().unwrap())
    }

    /// Returns errors of the page's scripts, and actions that the browser blocked.
    pub(crate) fn console_errors(&mut self) -> Vec<String> {
        // Earlier events arrive before this response.
        self.ask("Runtime.evaluate", json!({"expression": "0"}));
        let wire = self.browser.wire();
        let own = wire.events.iter().filter(|event| event["sessionId"] == self.session.as_str());
        let bad = own.filter(|event| {
            event["method"] == "Runtime.exceptionThrown"
                || event["method"] == "Runtime.consoleAPICalled" && event["params"]["type"] == "error"
                || event["method"] == "Log.entryAdded" && event["params"]["entry"]["level"] == "error"
        });
        bad.map(|event| event["params"].to_string()).collect()
    }
}

/// Decodes base64 (RFC 4648, section 4).
fn decode_base64(text: &str) -> Vec<u8> {
    let value = |c: u8| match c {
        b'A'..=b'Z' => u32::from(c - b'A'),
        b'a'..=b'z' => u32::from(c - b'a') + 26,
        b'0'..=b'9' => u32::from(c - b'0') + 52,
        b'+' => 62,
        _ => 63,
    };
    let digits: Vec<u8> = text.bytes().filter(|c| *c != b'=').collect();
    let bytes = digits.chunks(4).flat_map(|four| {
        let bits = (0..4).fold(0, |bits, k| bits << 6 | four.get(k).map_or(0, |c| value(*c)));
        bits.to_be_bytes().into_iter().skip(1).take(four.len() - 1)
    });
    bytes.collect()
}
