// Connection to the server, and updates of the page.

const $ = (id) => document.getElementById(id);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5];

let socket = null;
let patience = 250; // milliseconds until the next attempt to connect
let contents = null;
let state = null;
let refusals = null; // last reported number of refused commands
let unseen = 0; // images received while the page was hidden
let noteTimer = 0;
let arrivals = [];
const history = { positions: new History(), efforts: new History(), forces: new History() };
const AXES = ["x", "y", "z"].map((name, column) => ({ name, column, color: ["#e4572e", "#2e9e5b", "#2f7ed8"][column] }));
let plotted = null; // name of the body whose contact force is plotted

function send(command) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(command));
}

const stage = new Stage($("stage"), send);
const joints = new Joints($("joints"), send, () => replot());
const timeline = new Timeline(document.querySelector(".bar"), send);

function link(name, text) {
  $("link").dataset.state = name;
  $("link").textContent = text;
  const off = name !== "connected";
  for (const control of document.querySelectorAll(".bar button, .bar select, #joints input[type=range], #camera, #overlays input")) {
    control.disabled = off;
  }
}

function connect() {
  link("connecting", "connecting");
  const url = new URL("/live", location.href);
  url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  url.search = location.search; // the token, if there is one
  const own = new WebSocket(url);
  own.binaryType = "arraybuffer";
  socket = own;
  own.addEventListener("open", () => {
    patience = 250;
    unseen = 0;
    link("connected", "connected");
    stage.size();
    wishes();
  });
  own.addEventListener("message", (event) => {
    if (own !== socket) return;
    if (typeof event.data === "string") tell(JSON.parse(event.data));
    else show(event.data);
  });
  own.addEventListener("close", (event) => {
    if (own !== socket) return;
    link("lost", event.reason ? `lost: ${event.reason}` : "lost: trying again");
    setTimeout(connect, patience);
    patience = Math.min(patience * 1.6, 5000);
  });
}

/** Restores the selections from before the connection was lost. */
function wishes() {
  const chosen = $("environment").value;
  if (chosen) send({ do: "environment", env: chosen === "all" ? null : Number(chosen) });
  if (contents) send({ do: "camera", name: $("camera").value || null });
  for (const box of document.querySelectorAll("#overlays input")) {
    send({ do: "overlay", name: box.value, on: box.checked });
  }
}

function tell(message) {
  if (message.is === "contents") {
    contents = message.contents;
    send({ do: "seen", what: "state" });
    build();
  } else if (message.is === "state") {
    state = message.state;
    send({ do: "seen", what: "state" });
    refresh();
  } else if (message.is === "refused") {
    note(message.reason);
  }
}

function note(text) {
  const box = $("note");
  box.textContent = text;
  box.hidden = false;
  clearTimeout(noteTimer);
  noteTimer = setTimeout(() => { box.hidden = true; }, 8000);
}

/** Shows an image message: length of the description, description, image file. */
async function show(buffer) {
  try {
    const length = new DataView(buffer).getUint32(0, true);
    const about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const file = new Blob([new Uint8Array(buffer, 4 + length)], { type: about.type });
    if (about.shows === "stage") {
      await paint($("stage"), file);
      $("cover").hidden = true;
      arrivals.push(performance.now());
    } else if (about.camera === $("camera").value) {
      await paint($("panel"), file);
      $("panel").hidden = false;
      $("panel-note").textContent = `environment ${about.environment}`;
    }
  } catch (error) {
    console.error("an image could not be shown", error);
  } finally {
    // A hidden tab acknowledges no images, so the server renders none until the tab is visible.
    if (document.hidden) unseen += 1; else send({ do: "seen", what: "picture" });
  }
}

document.addEventListener("visibilitychange", () => {
  if (document.hidden) return;
  for (; unseen > 0; unseen -= 1) send({ do: "seen", what: "picture" });
});

function options(select, entries) {
  const before = select.value;
  select.replaceChildren(...entries.map(([value, text]) => new Option(text, value)));
  if (entries.some(([value]) => value === before)) select.value = before;
}

/** Builds the controls that depend on the scene contents. */
function build() {
  const envs = Array.from({ length: contents.environments }, (_, k) => [String(k), `${k}`]);
  options($("environment"), envs.length > 1 ? [["all", `all ${envs.length}`], ...envs] : envs);
  options($("speed"), [...SPEEDS.map((s) => [String(s), s === 1 ? "real time" : `${s} ×`]), ["max", "unlimited"]]);
  options($("camera"), contents.cameras.map((c) => [c, c]));
  $("camera-card").hidden = contents.cameras.length === 0;
  $("panel").hidden = true;
  if (contents.cameras.length) send({ do: "camera", name: $("camera").value });
  const driven = contents.robots.some((robot) => robot.joints.length);
  $("joint-card").hidden = !driven;
  $("plots").hidden = false;
  for (const figure of document.querySelectorAll("#plots .of-joints")) figure.hidden = !driven;
  history.positions.clear();
  history.efforts.clear();
  history.forces.clear();
  joints.build(contents.robots);
  $("overlays").hidden = contents.overlays.length === 0;
  $("overlays").replaceChildren($("overlays").querySelector("legend"), ...contents.overlays.map((overlay) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.value = overlay.name;
    box.checked = overlay.on;
    box.addEventListener("change", () => send({ do: "overlay", name: overlay.name, on: box.checked }));
    label.append(box, overlay.title);
    return label;
  }));
  document.title = contents.robots.length ? `${contents.robots.map((r) => r.name).join(", ")} – Kinetoscope` : "Kinetoscope";
}

/** Shows the current state. */
function refresh() {
  $("time").textContent = `${state.time.toFixed(3)} s`;
  $("rate").textContent = state.paused ? "paused" : state.rate === null ? "–" : `${state.rate.toFixed(2)} ×`;
  $("viewers").textContent = state.viewers;
  const pause = $("pause");
  pause.textContent = state.paused ? "Play" : "Pause";
  pause.setAttribute("aria-pressed", String(state.paused));
  const speed = state.speed === null ? "max" : String(state.speed);
  if (document.activeElement !== $("speed")) {
    if (![...$("speed").options].some((option) => option.value === speed)) $("speed").add(new Option(`${speed} ×`, speed));
    $("speed").value = speed;
  }
  const everywhere = contents?.environments > 1 ? "all" : "0";
  const environment = state.environment === null ? everywhere : String(state.environment);
  if (document.activeElement !== $("environment")) $("environment").value = environment;
  const recording = state.recording;
  $("record").hidden = recording === null;
  if (recording !== null) {
    $("record").textContent = recording.on ? "Stop recording" : "Record";
    $("record").setAttribute("aria-pressed", String(recording.on));
  }
  $("record-text").textContent = recording?.text ?? "";
  if (state.refusals !== refusals && state.refused !== null) note(state.refused);
  refusals = state.refusals;
  $("diverged").hidden = state.diverged.length === 0;
  $("diverged").textContent = state.diverged.join("; ");
  select(state.selected);
  timeline.show(state.timeline);
  joints.show(state.robots);
  history.positions.add(state.time, state.robots.flatMap((robot) => robot.positions));
  history.efforts.add(state.time, state.robots.flatMap((robot) => robot.efforts));
}

/** Shows the selection and its contact force. */
function select(selected) {
  $("selected-card").hidden = selected === null;
  $("selected").textContent = selected === null ? "" : selected.says.join("\n");
  const whose = selected === null || selected.quaternion === null ? "" : `${selected.name}, environment ${selected.environment}`;
  if (whose !== plotted) {
    plotted = whose;
    history.forces.clear();
    const keys = AXES.map((axis) => {
      const key = document.createElement("span");
      key.className = "key";
      key.style.color = axis.color;
      key.textContent = axis.name;
      return key;
    });
    if (whose) $("forces-title").replaceChildren(`Contact force on ${whose}`, ...keys);
    else $("forces-title").textContent = "Contact force on the selection: click on a body";
  }
  if (whose && selected.force !== null) history.forces.add(state.time, selected.force);
}

function replot() {
  const units = new Set(contents?.robots.flatMap((robot) => robot.joints.map((joint) => joint.unit)));
  const unit = (turns, slides) => [units.has("rad") && turns, units.has("m") && slides].filter(Boolean).join(", ");
  plot($("positions"), history.positions, joints.lines(), unit("rad", "m"));
  plot($("efforts"), history.efforts, joints.lines(), unit("N m", "N"));
  plot($("forces"), history.forces, AXES, "N");
}

$("pause").addEventListener("click", () => send({ do: state?.paused ? "play" : "pause" }));
$("step").addEventListener("click", () => send({ do: "step" }));
$("reset").addEventListener("click", () => send({ do: "reset" }));
$("home").addEventListener("click", () => send({ do: "home" }));
$("unselect").addEventListener("click", () => send({ do: "unselect" }));
$("record").addEventListener("click", () => send({ do: "record", on: !state?.recording?.on }));
$("speed").addEventListener("change", (event) => {
  const value = event.target.value;
  send({ do: "speed", factor: value === "max" ? null : Number(value) });
  event.target.blur();
});
$("environment").addEventListener("change", (event) => {
  const value = event.target.value;
  history.positions.clear();
  history.efforts.clear();
  history.forces.clear();
  send({ do: "environment", env: value === "all" ? null : Number(value) });
  event.target.blur();
});
$("camera").addEventListener("change", (event) => {
  $("panel").hidden = true;
  send({ do: "camera", name: event.target.value });
});

setInterval(() => {
  if (document.hidden || !contents) return;
  replot();
}, 120);
setInterval(() => {
  const now = performance.now();
  arrivals = arrivals.filter((at) => now - at < 2000);
  $("fps").textContent = (arrivals.length / 2).toFixed(0);
}, 500);

connect();
