//! The page of the browser view in Chromium, without a screen: it loads, a picture arrives, a slider moves the joint, pause
//! pauses. Skipped where there is no Chromium, except in CI.

mod chromium;

use crate::serve::running::{Running, scene, wait_until};
use chromium::{Chromium, Tab};
use kinetoscope::RecordedFilm;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::record::{Film, Recording};
use kinetoscope::view::control::{Play, Speed};
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Where screenshots of the page are written, for the documentation; nowhere without it.
const SCREENSHOTS: &str = "KINETOSCOPE_SCREENSHOTS";

/// A browser, or nothing where there is none and nobody requires one.
fn browser() -> Chromium {
    Chromium::start(&testkit::needs::chromium())
}

/// The page of a simulation, when it is connected.
fn page<'a>(browser: &'a Chromium, running: &Running) -> Tab<'a> {
    page_at(browser, &running.url)
}

fn page_at<'a>(browser: &'a Chromium, url: &str) -> Tab<'a> {
    let mut tab = browser.open(url);
    tab.wait_until("connected", "document.getElementById('link').dataset.state === 'connected'");
    tab
}

fn screenshot(tab: &mut Tab<'_>, name: &str) {
    if let Some(folder) = std::env::var_os(SCREENSHOTS) {
        std::fs::write(PathBuf::from(folder).join(name), tab.screenshot()).unwrap();
    }
}

/// Colours of the stage's canvas, and the part of its pixels that is red as the cube is.
const LOOK: &str = "(() => {
    const canvas = document.getElementById('stage');
    const bytes = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    const colors = new Set();
    let red = 0;
    for (let k = 0; k < bytes.length; k += 4) {
        const [r, g, b] = [bytes[k], bytes[k + 1], bytes[k + 2]];
        colors.add(65536 * r + 256 * g + b);
        if (r > 60 && r > 2.5 * Math.max(g, b)) red += 1;
    }
    return { colors: colors.size, red: red / (canvas.width * canvas.height), width: canvas.width, height: canvas.height };
})()";

/// A number that is another one for another picture on the stage.
const PICTURE: &str = "(() => {
    const canvas = document.getElementById('stage');
    const bytes = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let hash = 0;
    for (const byte of bytes) hash = (31 * hash + byte) | 0;
    return hash;
})()";

/// How many pixels of a plot have nearly the colour of its first line.
fn of_the_first_line(plot: &str) -> String {
    format!(
        "(() => {{
            const canvas = document.getElementById('{plot}');
            const bytes = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
            let count = 0;
            for (let k = 0; k < bytes.length; k += 4) {{
                const off = Math.abs(bytes[k] - 0x2f) + Math.abs(bytes[k + 1] - 0x7e) + Math.abs(bytes[k + 2] - 0xd8);
                if (bytes[k + 3] > 200 && off < 30) count += 1;
            }}
            return count;
        }})()"
    )
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn the_page_shows_the_simulation_and_acts_on_it() {
    let browser = browser();
    let running = Running::start(2);
    let mut tab = page(&browser, &running);
    tab.wait_until("its title", "document.title === 'arm – Kinetoscope'");

    // A picture arrives, as large as it is shown, with the cube in it.
    tab.wait_until("a picture", "document.getElementById('cover').hidden");
    tab.wait_until(
        "a picture of the canvas' size",
        "(() => { const c = document.getElementById('stage'); return c.width === c.clientWidth && c.height === c.clientHeight; })()",
    );
    let look = tab.evaluate(LOOK);
    assert!(look["colors"].as_u64() > Some(100) && look["red"].as_f64() > Some(0.001), "{look}");
    assert!(look["width"].as_u64() > Some(400), "{look}");

    // So does the camera's.
    tab.wait_until("the camera", "!document.getElementById('panel').hidden");
    let size = tab.evaluate("[document.getElementById('panel').width, document.getElementById('panel').height]");
    assert_eq!(size, json!([128, 96]));

    // A slider that is dragged by the mouse moves its joint, in the simulation.
    let sliders =
        tab.evaluate("[...document.querySelectorAll('#joints input[type=range]')].map((s) => s.dataset.joint)");
    assert_eq!(sliders, json!(["JOINT1", "JOINT2", "JOINT3", "JOINT4", "JOINT5", "JOINT6"]));
    let slider = "document.querySelector('#joints input[data-joint=JOINT1]')";
    let [x, y, width, _] = tab.rectangle(slider);
    let range = tab.evaluate(&format!("[Number({slider}.min), Number({slider}.max)]"));
    let [lower, upper] = [0, 1].map(|k| range[k].as_f64().unwrap());
    tab.drag([x + 0.5 * width, y], [x + 0.6 * width, y]);
    let target = tab.evaluate(&format!("{slider}.valueAsNumber")).as_f64().unwrap();
    // A tenth of the way is a tenth of the range, but for the width of the thumb (16 of some 300 pixels).
    let expected = 0.5 * (lower + upper) + 0.1 * (upper - lower);
    assert!((target - expected).abs() < 0.02 * (upper - lower), "{target} for {expected}");
    running.wait_until("the joint comes to where the slider is", |now| {
        now.steps > 0 && (now.positions[(0, 0)] - target).abs() < 0.02
    });

    // Pause pauses, by a click, and the button says what it does next.
    tab.click("document.getElementById('pause')");
    tab.wait_until("paused", "document.getElementById('pause').textContent === 'Play'");
    let held = running.now().steps;
    std::thread::sleep(Duration::from_millis(400));
    assert!(running.now().steps <= held + 1, "it steps on");
    assert_eq!(tab.evaluate("document.getElementById('rate').textContent"), "paused");
    let time = "document.getElementById('time').textContent";
    let before = tab.evaluate(time);
    tab.click("document.getElementById('step')");
    tab.wait_until("a step", &format!("{time} !== {before}"));

    // Position and effort of the first joint are plotted, unless its mark is taken away.
    // (The others would be drawn over it: without them.)
    let marks = "[...document.querySelectorAll('#joints .mark')]";
    tab.evaluate(&format!("{marks}.slice(1).filter((mark) => mark.checked).forEach((mark) => mark.click())"));
    let mark = "document.querySelector('#joints .mark')";
    for plot in ["positions", "efforts"] {
        let pixels = of_the_first_line(plot);
        tab.wait_until("a line", &format!("{pixels} > 30"));
        tab.click(mark);
        tab.wait_until("no line", &format!("{pixels} === 0"));
        tab.click(mark);
        tab.wait_until("the line again", &format!("{pixels} > 30"));
    }

    // What is drawn over the scene, and which environments are: another picture, and the same again.
    let now_shown = |tab: &mut Tab<'_>| {
        std::thread::sleep(Duration::from_millis(500));
        tab.evaluate(PICTURE)
    };
    // Both from where they are seen as a whole now, which is not quite where the first picture was taken from.
    tab.choose("environment", "1");
    tab.choose("environment", "all");
    let all = now_shown(&mut tab);
    for overlay in ["contacts", "frames", "joints", "masses", "names", "collisions", "visuals"] {
        let tick = format!("document.querySelector('#overlays input[value={overlay}]')");
        tab.click(&tick);
        tab.wait_until(overlay, &format!("{PICTURE} !== {all}"));
        tab.click(&tick);
        tab.wait_until(&format!("{overlay} gone"), &format!("{PICTURE} === {all}"));
    }
    let red = format!("{LOOK}.red");
    let of_two = tab.evaluate(&red).as_f64().unwrap();
    tab.choose("environment", "1");
    // One alone is looked at from nearer.
    tab.wait_until("one environment", &format!("{red} > 1.2 * {of_two}"));
    tab.choose("environment", "all");
    tab.wait_until("both", &format!("{PICTURE} === {all}"));

    tab.click("document.getElementById('reset')");
    tab.wait_until("the beginning", &format!("{time} === '0.000 s'"));
    tab.click("document.getElementById('pause')");
    running.wait_until("it goes on", |now| now.steps > held + 50);

    // One environment of the two, another speed, another view: everything is taken by the simulation without a word.
    tab.choose("environment", "1");
    tab.choose("speed", "1");
    tab.wait_until("real time", "document.getElementById('speed').value === '1'");
    let [x, y, width, height] = tab.rectangle("document.getElementById('stage')");
    tab.drag([x + 0.5 * width, y], [x + 0.6 * width, y + 0.1 * height]);
    std::thread::sleep(Duration::from_secs(3));
    assert_eq!(tab.evaluate("document.getElementById('note').hidden"), true, "nothing was refused");
    assert_eq!(tab.evaluate("document.getElementById('environment').value"), "1");
    screenshot(&mut tab, "serve.png");
    assert_eq!(tab.complaints(), Vec::<String>::new());
}

/// Where the cube is on the stage's canvas, in parts of it; null where it is not seen.
const CUBE: &str = "(() => {
    const canvas = document.getElementById('stage');
    const bytes = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    let [x, y, n] = [0, 0, 0];
    for (let k = 0; k < bytes.length; k += 4) {
        if (!(bytes[k] > 60 && bytes[k] > 2.5 * Math.max(bytes[k + 1], bytes[k + 2]))) continue;
        x += (k / 4) % canvas.width;
        y += Math.floor(k / 4 / canvas.width);
        n += 1;
    }
    return n < 50 ? null : [x / n / canvas.width, y / n / canvas.height];
})()";

/// Numbers behind a word in what is said of the selection.
fn said(tab: &mut Tab<'_>, word: &str) -> Vec<f64> {
    let text = tab.evaluate("document.getElementById('selected').textContent");
    let line = text.as_str().unwrap().lines().find_map(|line| line.split_once(word)).map_or("", |(_, rest)| rest);
    line.split_whitespace().filter_map(|number| number.parse().ok()).collect()
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn a_click_selects_its_force_is_plotted_and_a_drag_with_ctrl_pulls() {
    let browser = browser();
    let running = Running::start(1);
    let mut tab = page(&browser, &running);
    assert_eq!(tab.evaluate("document.getElementById('selected-card').hidden"), true);
    let title = "document.getElementById('forces-title').textContent";
    tab.wait_until("a hint", &format!("{title}.includes('click on a body')"));
    // The cube has come to rest by then: 1.5 s of simulation.
    tab.wait_until("1.5 s", "parseFloat(document.getElementById('time').textContent) > 1.5");
    tab.wait_until("the cube is seen", &format!("{CUBE} !== null"));
    let at = tab.evaluate(CUBE);
    let [left, middle, width, height] = tab.rectangle("document.getElementById('stage')");
    let [u, v] = [0, 1].map(|k| at[k].as_f64().unwrap());
    let place = [left + u * width, middle + (v - 0.5) * height];
    tab.drag(place, place);
    tab.wait_until("it is selected", "document.getElementById('selected').textContent.startsWith('cube ')");
    tab.wait_until("forces", "/contacts: force on it/.test(document.getElementById('selected').textContent)");
    // The contacts carry the weight of 1 kg; what is said is rounded to hundredths of a newton.
    let force = said(&mut tab, "force on it");
    assert!(force.len() == 3 && (force[2] - 9.81).abs() < 0.011 && force[0].abs() < 0.011, "{force:?}");
    // And are plotted: the line of z has its colour, over most of a second's width of the plot at least.
    assert_eq!(tab.evaluate(title), "Contact force on cube, environment 0xyz");
    tab.wait_until(
        "a line",
        "(() => {
            const canvas = document.getElementById('forces');
            const bytes = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
            const columns = new Set();
            for (let k = 0; k < bytes.length; k += 4) {
                if (Math.abs(bytes[k] - 0x2f) + Math.abs(bytes[k + 1] - 0x7e) + Math.abs(bytes[k + 2] - 0xd8) < 60 && bytes[k + 3] > 200) {
                    columns.add((k / 4) % canvas.width);
                }
            }
            return columns.size > canvas.width / 12;
        })()",
    );
    let rest = said(&mut tab, "position")[2];
    assert!((rest - 0.2).abs() < 2e-3, "{rest}");
    screenshot(&mut tab, "serve_selected.png");
    // Pulled up by a part of the picture's height it leaves the ground; let go, it comes back.
    let up = [place[0], place[1] - 0.3 * height];
    tab.hold(place, up, true);
    tab.wait_until("nothing touches it", "/no contact/.test(document.getElementById('selected').textContent)");
    assert!(said(&mut tab, "position")[2] > rest);
    screenshot(&mut tab, "serve_pulled.png");
    tab.let_go(up);
    tab.wait_until("it is back", "/contacts?: force on it/.test(document.getElementById('selected').textContent)");
    tab.click("document.getElementById('unselect')");
    tab.wait_until("nothing is selected", "document.getElementById('selected-card').hidden");
    assert_eq!(tab.evaluate("document.getElementById('note').hidden"), true, "nothing was refused");
    assert_eq!(tab.complaints(), Vec::<String>::new());
}

/// Ends the showing of a recording, however it ends.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn the_slider_of_time_seeks_in_a_recording() {
    let browser = browser();
    // The cube falls from 2 m for half a second, which is 1.2 m.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fall.mcap");
    let mut sim = scene(1);
    let cube = sim.rigid_object_id("cube").unwrap();
    sim.rigid_object_mut(cube).write_pose(&array![[0.7, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0]], None).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(100);
    sim.finish_recording(recorder).unwrap();
    let (film, mut sim) = Film::of(&Recording::open(&path).unwrap(), None).unwrap();
    let served = sim.serve_with("127.0.0.1:0", ServeCfg { speed: Some(Speed::REAL), ..ServeCfg::default() }).unwrap();
    let (url, over) = (served.url().to_string(), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let _ends = Ends(&over);
            let mut tab = page_at(&browser, &url);
            let (slider, text) =
                ("document.getElementById('timeline')", "document.querySelector('#timeline-row output')");
            tab.wait_until("a time line", "!document.getElementById('timeline-row').hidden");
            tab.wait_until("the end", "document.getElementById('pause').textContent === 'Play'");
            tab.wait_until("its time", &format!("{text}.textContent === '0.50 of 0.50 s'"));
            tab.wait_until("the cube is seen", &format!("{CUBE} !== null"));
            let [x, y, width, _] = tab.rectangle(slider);
            let mut last = x + width - 8.0;
            let mut heights = Vec::new();
            // The middle of the thumb, 16 pixels wide, goes from end to end of the line.
            for share in [0.0, 0.5, 0.8] {
                let to = x + 8.0 + share * (width - 16.0);
                tab.drag([last, y], [to, y]);
                last = to;
                let expected = 0.5 * share;
                // Steps are 5 ms apart, a pixel is about one; where the mouse takes the thumb is two pixels off at most.
                let near = |what: &str| format!("Math.abs({what} - {expected}) < 0.006 + 2 * 0.5 / {width}");
                tab.wait_until("the time that was asked for", &near(&format!("parseFloat({text}.textContent)")));
                tab.wait_until("the slider shows it", &near(&format!("{slider}.valueAsNumber")));
                tab.wait_until("the page's clock", &near("parseFloat(document.getElementById('time').textContent)"));
                // Pictures come a moment later: two that are the same are of one time.
                let mut height = f64::NAN;
                loop {
                    std::thread::sleep(Duration::from_millis(300));
                    let now = tab.evaluate(CUBE)[1].as_f64().unwrap();
                    if (now - height).abs() < 1e-3 {
                        break;
                    }
                    height = now;
                }
                heights.push(height);
                if share == 0.5 {
                    screenshot(&mut tab, "replay_page.png");
                }
            }
            // It falls by g t² / 2: 0, 0.31 and 0.78 m. In the picture the second way is longer than the first, both are seen.
            let fallen = [heights[1] - heights[0], heights[2] - heights[1]];
            assert!(fallen[0] > 0.01 && fallen[1] > 1.1 * fallen[0], "{heights:?}");
            // From there it is played to the end.
            tab.click("document.getElementById('pause')");
            tab.wait_until("the end again", &format!("{text}.textContent === '0.50 of 0.50 s'"));
            tab.wait_until("it holds", "document.getElementById('pause').textContent === 'Play'");
            assert_eq!(tab.evaluate("document.getElementById('note').hidden"), true, "nothing was refused");
            assert_eq!(tab.complaints(), Vec::<String>::new());
        });
        sim.play(&mut RecordedFilm(film), &mut || !over.load(Ordering::Acquire)).unwrap();
    });
    served.close(&mut sim).unwrap();
    // The control: a simulation that runs has no time line.
    let running = Running::start(1);
    let mut tab = page(&browser, &running);
    tab.wait_until("a picture", "document.getElementById('cover').hidden");
    assert_eq!(tab.evaluate("document.getElementById('timeline-row').hidden"), true);
    assert_eq!(tab.evaluate("document.getElementById('timeline-row').getBoundingClientRect().height"), 0);
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn the_record_button_writes_a_file() {
    let browser = browser();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let files = Arc::new(Mutex::new(FileRecording::new(RecorderCfg::new(&path))));
    let recording = Some(RecordButton::shared(files));
    let running = Running::start_at(1, "127.0.0.1:0", ServeCfg { recording, ..ServeCfg::default() });
    let mut tab = page(&browser, &running);
    let button = "document.getElementById('record')";
    tab.wait_until("a button", &format!("!{button}.hidden && {button}.textContent === 'Record'"));
    tab.click(button);
    tab.wait_until("it records", &format!("{button}.textContent === 'Stop recording'"));
    tab.wait_until(
        "rows are told",
        "/^run.npz: \\d\\d+ rows$/.test(document.getElementById('record-text').textContent)",
    );
    tab.click(button);
    tab.wait_until("it has ended", &format!("{button}.textContent === 'Record'"));
    assert!(path.is_file());
    assert_eq!(tab.complaints(), Vec::<String>::new());
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn a_lost_connection_is_said_and_found_again() {
    let browser = browser();
    let running = Running::start(1);
    let address = running.address.to_string();
    let mut tab = page(&browser, &running);
    tab.wait_until("a picture", "document.getElementById('cover').hidden");
    drop(running);
    tab.wait_until("lost", "document.getElementById('link').dataset.state !== 'connected'");
    tab.wait_until("nothing can be pressed", "document.getElementById('pause').disabled");
    // The port is free again once the system has forgotten the old connections.
    let again = Running::start_at(1, &address, ServeCfg::default());
    tab.wait_until("found again", "document.getElementById('link').dataset.state === 'connected'");
    tab.wait_until("it can be pressed", "!document.getElementById('pause').disabled");
    wait_until("one viewer", || again.viewers() == 1);
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn the_page_is_readable_dark_and_narrow() {
    let browser = browser();
    let running = Running::start(1);
    let mut tab = page(&browser, &running);
    tab.wait_until("a picture", "document.getElementById('cover').hidden");
    // Every control has a name for those who do not see it.
    let unnamed = tab.evaluate(
        "[...document.querySelectorAll('button, input, select, canvas')]
            .filter((e) => !(e.labels?.length || e.getAttribute('aria-label') || e.getAttribute('aria-labelledby')
                || e.tagName === 'BUTTON' && e.textContent.trim()))
            .map((e) => e.outerHTML)",
    );
    assert_eq!(unnamed, json!([]));
    for (scheme, width, name) in
        [("light", 1400, "serve_light.png"), ("dark", 1400, "serve_dark.png"), ("light", 420, "serve_narrow.png")]
    {
        tab.show_as(scheme, [width, 900]);
        // Contrast of text on its ground, after WCAG 2: 4.5 is asked for.
        let contrast = tab.evaluate(
            "(() => {
                const parse = (c) => c.match(/[\\d.]+/g).slice(0, 3).map(Number);
                const light = (c) => parse(c).map((v) => v / 255).map((v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
                    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
                const card = getComputedStyle(document.querySelector('.card')).backgroundColor;
                const of = (e) => { const [a, b] = [light(getComputedStyle(e).color), light(card)].sort((x, y) => y - x); return (a + 0.05) / (b + 0.05); };
                return Math.min(...['h2', '.hint', '.joint .name', '.joint output', '#link', 'dt'].map((s) => of(document.querySelector(s))));
            })()",
        );
        assert!(contrast.as_f64() >= Some(4.5), "{scheme}: {contrast}");
        let overflow = tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert_eq!(overflow, 0, "{scheme} {width}: the page is wider than its window");
        std::thread::sleep(Duration::from_millis(700));
        screenshot(&mut tab, name);
    }
    assert_eq!(tab.complaints(), Vec::<String>::new());
}
