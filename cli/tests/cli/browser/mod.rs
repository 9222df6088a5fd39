//! The page of the browser view in Chromium: it shows the simulation and controls it.

mod chromium;
mod frames;
mod video;

use super::serve::running::{ServedSimulation, play_fall};
use chromium::{Chromium, Tab};
use kinetoscope::FileRecording;
use kinetoscope::record::RecorderCfg;
use kinetoscope::viewer::{RecordButton, ServeCfg};
use kinetoscope_testkit::wait;
use serde_json::json;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Environment variable with the folder for screenshots of the page, for the documentation.
const SCREENSHOTS: &str = "KINETOSCOPE_SCREENSHOTS";

fn browser() -> Chromium {
    Chromium::start(&kinetoscope_testkit::test_resources::chromium())
}

/// Opens the page at an address and waits for the connection.
fn page<'a>(browser: &'a Chromium, url: &str) -> Tab<'a> {
    let mut tab = browser.open(url);
    tab.wait_until("connected", "$('link').dataset.state === 'connected'");
    tab
}

/// Opens the page of a simulation and waits for its first image.
fn page_of<'a>(browser: &'a Chromium, running: &ServedSimulation) -> Tab<'a> {
    let mut tab = page(browser, &running.url);
    tab.wait_until("an image", "$('cover').hidden");
    tab
}

fn screenshot(tab: &mut Tab<'_>, name: &str) {
    if let Some(folder) = std::env::var_os(SCREENSHOTS) {
        std::fs::write(PathBuf::from(folder).join(name), tab.screenshot()).unwrap();
    }
}

/// Asserts that the page refused no command and reported no error.
#[track_caller]
fn assert_content(tab: &mut Tab<'_>) {
    assert_eq!(tab.evaluate("$('note').hidden"), true, "nothing was refused");
    assert_eq!(tab.console_errors(), Vec::<String>::new());
}

/// Test functions that are defined in every page. `$` finds an element. `pixels` returns the bytes of a canvas and its
/// size. `look` returns the number of colors, the share of pixels that are as red as the cube, and their center in
/// fractions of the canvas. `hash` differs for different images. `blue` returns the number of pixels with nearly the
/// color of a plot's blue line, and the share of columns that contain one.
const TOOLS: &str = "
window.$ = (id) => document.getElementById(id);
window.pixels = (id) => {
    const { width, height } = $(id);
    return { bytes: $(id).getContext('2d').getImageData(0, 0, width, height).data, width, height };
};
window.look = () => {
    const { bytes, width, height } = pixels('stage');
    const colors = new Set();
    let [x, y, red] = [0, 0, 0];
    for (let k = 0; k < bytes.length; k += 4) {
        const [r, g, b] = [bytes[k], bytes[k + 1], bytes[k + 2]];
        colors.add(65536 * r + 256 * g + b);
        if (!(r > 60 && r > 2.5 * Math.max(g, b))) continue;
        x += (k / 4) % width;
        y += Math.floor(k / 4 / width);
        red += 1;
    }
    const middle = red < 50 ? null : [x / red / width, y / red / height];
    return { colors: colors.size, red: red / (width * height), middle, width, height };
};
window.hash = () => pixels('stage').bytes.reduce((hash, byte) => (31 * hash + byte) | 0, 0);
window.blue = (id, limit) => {
    const { bytes, width } = pixels(id);
    const [columns, count] = [new Set(), []];
    for (let k = 0; k < bytes.length; k += 4) {
        const off = Math.abs(bytes[k] - 0x2f) + Math.abs(bytes[k + 1] - 0x7e) + Math.abs(bytes[k + 2] - 0xd8);
        if (!(bytes[k + 3] > 200 && off < limit)) continue;
        columns.add((k / 4) % width);
        count.push(k);
    }
    return { count: count.length, columns: columns.size / width };
};
";

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn simulation() {
    let browser = browser();
    let running = ServedSimulation::start(2);
    let mut tab = page_of(&browser, &running);
    tab.wait_until("its title", "document.title === 'arm – Kinetoscope'");

    // An image arrives in its displayed size and shows the cube.
    let fits = "(({ width, height, clientWidth, clientHeight }) => width === clientWidth && height === clientHeight)";
    tab.wait_until("an image of the canvas' size", &format!("{fits}($('stage'))"));
    let look = tab.evaluate("look()");
    assert!(look["colors"].as_u64() > Some(100) && look["red"].as_f64() > Some(0.001), "{look}");
    assert!(look["width"].as_u64() > Some(400), "{look}");

    // The image of the camera sensor arrives too.
    tab.wait_until("the camera", "!$('panel').hidden");
    assert_eq!(tab.evaluate("[$('panel').width, $('panel').height]"), json!([128, 96]));

    // A slider dragged with the mouse moves its joint in the simulation.
    let sliders =
        tab.evaluate("[...document.querySelectorAll('#joints input[type=range]')].map((s) => s.dataset.joint)");
    assert_eq!(sliders, json!(["JOINT1", "JOINT2", "JOINT3", "JOINT4", "JOINT5", "JOINT6"]));
    let slider = "document.querySelector('#joints input[data-joint=JOINT1]')";
    let [x, y, width, _] = tab.rectangle(slider);
    let [lower, upper] = ["min", "max"].map(|end| tab.number(&format!("Number({slider}.{end})")));
    tab.drag([x + 0.5 * width, y], [x + 0.6 * width, y]);
    let target = tab.number(&format!("{slider}.valueAsNumber"));
    // A tenth of the slider is a tenth of the range, except for the width of the thumb (16 of about 300 pixels).
    let expected = 0.5 * (lower + upper) + 0.1 * (upper - lower);
    assert!((target - expected).abs() < 0.02 * (upper - lower), "{target} for {expected}");
    running.wait_until("the joint comes to where the slider is", |now| {
        now.steps > 0 && (now.positions[(0, 0)] - target).abs() < 0.02
    });

    // A click on the pause button pauses, and the button then shows its next action.
    tab.click("$('pause')");
    tab.wait_until("paused", "$('pause').textContent === 'Play'");
    let held = running.now().steps;
    std::thread::sleep(Duration::from_millis(400));
    assert!(running.now().steps <= held + 1, "it steps on");
    assert_eq!(tab.evaluate("$('rate').textContent"), "paused");
    let before = tab.evaluate("$('time').textContent");
    tab.click("$('step')");
    tab.wait_until("a step", &format!("$('time').textContent !== {before}"));

    // Position and effort of the first joint are plotted unless its box is unchecked. (The other joints are hidden,
    // because they would be drawn on top.)
    let marks = "[...document.querySelectorAll('#joints .mark')]";
    tab.evaluate(&format!("{marks}.slice(1).filter((mark) => mark.checked).forEach((mark) => mark.click())"));
    let mark = "document.querySelector('#joints .mark')";
    for plot in ["positions", "efforts"] {
        let pixels = format!("blue('{plot}', 30).count");
        tab.wait_until("a line", &format!("{pixels} > 30"));
        tab.click(mark);
        tab.wait_until("no line", &format!("{pixels} === 0"));
        tab.click(mark);
        tab.wait_until("the line again", &format!("{pixels} > 30"));
    }

    // Overlays and the shown environments change the image, and undoing the change restores it. The reference is the
    // view that frames both environments now, which differs slightly from the first image.
    tab.choose("environment", "1");
    tab.choose("environment", "all");
    std::thread::sleep(Duration::from_millis(500));
    let all = tab.evaluate("hash()");
    for overlay in ["contacts", "frames", "joints", "masses", "names", "collisions", "visuals"] {
        let tick = format!("document.querySelector('#overlays input[value={overlay}]')");
        tab.click(&tick);
        tab.wait_until(overlay, &format!("hash() !== {all}"));
        tab.click(&tick);
        tab.wait_until(&format!("{overlay} gone"), &format!("hash() === {all}"));
    }
    let of_two = tab.number("look().red");
    tab.choose("environment", "1");
    // A single environment is seen from closer: one cube instead of two, each larger by at least a fifth.
    tab.wait_until("one environment", &format!("hash() !== {all} && look().red > 0.5 * 1.2 * {of_two}"));
    tab.choose("environment", "all");
    tab.wait_until("both", &format!("hash() === {all}"));

    tab.click("$('reset')");
    tab.wait_until("the beginning", "$('time').textContent === '0.000 s'");
    tab.click("$('pause')");
    running.wait_until("it goes on", |now| now.steps > held + 50);

    // One of the two environments, another speed, another view: no command is refused.
    tab.choose("environment", "1");
    tab.choose("speed", "1");
    tab.wait_until("real time", "$('speed').value === '1'");
    let [x, y, width, height] = tab.rectangle("$('stage')");
    tab.drag([x + 0.5 * width, y], [x + 0.6 * width, y + 0.1 * height]);
    std::thread::sleep(Duration::from_secs(3));
    assert_eq!(tab.evaluate("$('environment').value"), "1");
    screenshot(&mut tab, "serve.png");
    assert_content(&mut tab);
}

/// A click selects the cube and plots its contact force, and a drag with Ctrl pulls it.
#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn selection() {
    /// Returns the numbers after a word in the text about the selection.
    fn said(tab: &mut Tab<'_>, word: &str) -> Vec<f64> {
        let text = tab.evaluate("$('selected').textContent");
        let line = text.as_str().unwrap().lines().find_map(|line| line.split_once(word)).map_or("", |(_, rest)| rest);
        line.split_whitespace().filter_map(|number| number.parse().ok()).collect()
    }
    let browser = browser();
    let running = ServedSimulation::start(1);
    let mut tab = page(&browser, &running.url);
    assert_eq!(tab.evaluate("$('selected-card').hidden"), true);
    tab.wait_until("a hint", "$('forces-title').textContent.includes('click on a body')");
    // The cube rests after 1.5 s of simulation.
    tab.wait_until("1.5 s", "parseFloat($('time').textContent) > 1.5");
    tab.wait_until("the cube is seen", "look().middle !== null");
    let [u, v] = [0, 1].map(|k| tab.number(&format!("look().middle[{k}]")));
    let [left, middle, width, height] = tab.rectangle("$('stage')");
    let place = [left + u * width, middle + (v - 0.5) * height];
    tab.drag(place, place);
    tab.wait_until("it is selected", "$('selected').textContent.startsWith('cube ')");
    tab.wait_until("forces", "/contacts: force on it/.test($('selected').textContent)");
    // The contacts carry the weight of 1 kg; the text is rounded to hundredths of a newton.
    let force = said(&mut tab, "force on it");
    assert!(force.len() == 3 && (force[2] - 9.81).abs() < 0.011 && force[0].abs() < 0.011, "{force:?}");
    // The force is plotted: the line of z has its color, over at least most of a second's width of the plot.
    assert_eq!(tab.evaluate("$('forces-title').textContent"), "Contact force on cube, environment 0xyz");
    tab.wait_until("a line", "blue('forces', 60).columns > 1 / 12");
    let rest = said(&mut tab, "position")[2];
    assert!((rest - 0.2).abs() < 2e-3, "{rest}");
    screenshot(&mut tab, "serve_selected.png");
    // Pulled up by a fraction of the image height, the cube leaves the ground; released, it falls back. It hangs
    // g / (8 rad/s)² = 0.15 m below the target and turns. At 0.3 of the height, one of its corners (0.35 m from the
    // center) still touches the ground at rest, so that only a fast machine sees the cube fly before it settles.
    let up = [place[0], place[1] - 0.65 * height];
    tab.hold(place, up, true);
    tab.wait_until("nothing touches it", "/no contact/.test($('selected').textContent)");
    assert!(said(&mut tab, "position")[2] > rest);
    screenshot(&mut tab, "serve_pulled.png");
    tab.release(up);
    tab.wait_until("it is back", "/contacts?: force on it/.test($('selected').textContent)");
    tab.click("$('unselect')");
    tab.wait_until("nothing is selected", "$('selected-card').hidden");
    assert_content(&mut tab);
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn time_line() {
    let browser = browser();
    // From 2 m, for half a second, which is 1.2 m.
    play_fall(2.0, |_, url| {
        let mut tab = page(&browser, url);
        let text = "document.querySelector('#timeline-row output').textContent";
        tab.wait_until("a time line", "!$('timeline-row').hidden");
        tab.wait_until("the end", "$('pause').textContent === 'Play'");
        tab.wait_until("its time", &format!("{text} === '0.50 of 0.50 s'"));
        tab.wait_until("the cube is seen", "look().middle !== null");
        let [x, y, width, _] = tab.rectangle("$('timeline')");
        let mut last = x + width - 8.0;
        // The center of the thumb, 16 pixels wide, moves from end to end of the slider.
        let heights = [0.0, 0.5, 0.8].map(|share| {
            let to = x + 8.0 + share * (width - 16.0);
            tab.drag([last, y], [to, y]);
            last = to;
            // Steps are 5 ms apart, about one pixel. The dragged thumb is off by at most two pixels.
            for time in
                [&format!("parseFloat({text})"), "$('timeline').valueAsNumber", "parseFloat($('time').textContent)"]
            {
                tab.wait_until(time, &format!("Math.abs({time} - {}) < 0.006 + 2 * 0.5 / {width}", 0.5 * share));
            }
            // The first view frames only the shown state. From here on, the view frames the whole fall.
            if share == 0.0 {
                tab.click("$('home')");
            }
            // Images arrive with a delay: two equal images belong to the same time.
            let mut height = f64::NAN;
            loop {
                std::thread::sleep(Duration::from_millis(300));
                let now = tab.number("look().middle[1]");
                if (now - height).abs() < 1e-3 {
                    break;
                }
                height = now;
            }
            if share == 0.5 {
                screenshot(&mut tab, "replay_page.png");
            }
            height
        });
        // It falls by g t² / 2: 0, 0.31 and 0.78 m. In the image, the second interval is longer than the first.
        let fallen = [heights[1] - heights[0], heights[2] - heights[1]];
        assert!(fallen[0] > 0.01 && fallen[1] > 1.1 * fallen[0], "{heights:?}");
        // From there, playback runs to the end.
        tab.click("$('pause')");
        tab.wait_until("the end again", &format!("{text} === '0.50 of 0.50 s'"));
        tab.wait_until("it holds", "$('pause').textContent === 'Play'");
        assert_content(&mut tab);
    });
    // Control: a running simulation has no timeline, and without a record button the page shows none.
    let running = ServedSimulation::start(1);
    let mut tab = page_of(&browser, &running);
    assert_eq!(tab.evaluate("[$('timeline-row').hidden, $('record').hidden]"), json!([true, true]));
    assert_eq!(tab.evaluate("$('timeline-row').getBoundingClientRect().height"), 0);
}

#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn record_button() {
    let browser = browser();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let files = Arc::new(Mutex::new(FileRecording::new(RecorderCfg::new(&path))));
    let record_button = Some(RecordButton::shared(files));
    let running = ServedSimulation::start_at(1, "127.0.0.1:0", ServeCfg { record_button, ..ServeCfg::default() });
    let mut tab = page(&browser, &running.url);
    tab.wait_until("a button", "!$('record').hidden && $('record').textContent === 'Record'");
    tab.click("$('record')");
    tab.wait_until("it records", "$('record').textContent === 'Stop recording'");
    tab.wait_until("its rows", "/^run.npz: \\d\\d+ rows$/.test($('record-text').textContent)");
    tab.click("$('record')");
    tab.wait_until("it has ended", "$('record').textContent === 'Record'");
    tab.wait_until("its size", "/^run.npz: .* MB$/.test($('record-text').textContent)");
    assert!(path.is_file());
    assert_eq!(tab.console_errors(), Vec::<String>::new());
}

/// A lost connection is reported and restored.
#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn reconnection() {
    let browser = browser();
    let running = ServedSimulation::start(1);
    let address = running.address.to_string();
    let mut tab = page_of(&browser, &running);
    drop(running);
    tab.wait_until("lost", "$('link').dataset.state !== 'connected'");
    tab.wait_until("nothing can be pressed", "$('pause').disabled");
    // The port becomes free again once the system has closed the old connections.
    let again = ServedSimulation::start_at(1, &address, ServeCfg::default());
    tab.wait_until("found again", "$('link').dataset.state === 'connected'");
    tab.wait_until("it can be pressed", "!$('pause').disabled");
    wait::until("one viewer", || again.viewers() == 1);
}

/// The page is readable in light and dark mode, in a narrow window, and with a screen reader.
#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn readability() {
    let browser = browser();
    let running = ServedSimulation::start(1);
    let mut tab = page_of(&browser, &running);
    // Every control has an accessible name.
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
        // Contrast of text on its background by WCAG 2, which requires 4.5.
        let contrast = tab.evaluate(
            "(() => {
                const parse = (c) => c.match(/[\\d.]+/g).slice(0, 3).map(Number);
                const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
                const light = (c) => parse(c).map((v) => linear(v / 255)).reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
                const card = light(getComputedStyle(document.querySelector('.card')).backgroundColor);
                const of = (e) => { const [a, b] = [light(getComputedStyle(e).color), card].sort((x, y) => y - x); return (a + 0.05) / (b + 0.05); };
                return Math.min(...['h2', '.hint', '.joint .name', '.joint output', '#link', 'dt'].map((s) => of(document.querySelector(s))));
            })()",
        );
        assert!(contrast.as_f64() >= Some(4.5), "{scheme}: {contrast}");
        let overflow = tab.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth");
        assert_eq!(overflow, 0, "{scheme} {width}: the page is wider than its window");
        std::thread::sleep(Duration::from_millis(700));
        screenshot(&mut tab, name);
    }
    assert_eq!(tab.console_errors(), Vec::<String>::new());
}
