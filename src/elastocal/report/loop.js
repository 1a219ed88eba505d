"use strict";
// Draws the page of a campaign from the JSON that stands in it; colours and dashes tell before from after without colour, too.
const data = JSON.parse(document.getElementById("data").textContent);
const BEFORE = { name: "before", dash: "solid", symbol: "circle-open", tip: "circle" };
const AFTER = { name: "after", dash: "dash", symbol: "cross", tip: "diamond" };
const SETTINGS = { responsive: true, displaylogo: false, displayModeBar: false };
const find = (id) => document.getElementById(id);
const chosen = (value) => [BEFORE, AFTER].filter((step) => value === "both" || value === step.name);

// Colours are those of the page, which has a light and a dark set.
const ink = {};
function takeColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["paper", "ink", "grid", "robot", "before", "after"]) ink[name] = style.getPropertyValue(`--${name}`).trim();
  BEFORE.color = ink.before;
  AFTER.color = ink.after;
}
const sheet = () => ({ paper_bgcolor: ink.paper, plot_bgcolor: ink.paper, font: { color: ink.ink } });

// The robot in space.
const VIEWS = { corner: [1, -1, 0.5], front: [1, 0, 0.1], side: [0, -1, 0.1], above: [0.01, 0, 1] };
const camera = { eye: { x: 1, y: -1, z: 0.5 }, center: { x: 0, y: 0, z: 0 } };
// Plots in space lie above their legend; of the angle under which plotly looks this is the tangent of half.
const [DOMAIN, HALF_ANGLE] = [{ x: [0, 1], y: [0.07, 1] }, Math.tan(Math.PI / 8)];
// Numbers of axes stand beside what is drawn.
const BESIDE = 1.05;

function factor() {
  // From one tenth to ten times the factor at which arrows of the middle length are well seen.
  return data.usual_factor * 10 ** ((find("factor").value - 50) / 50);
}

const tip = (step, number) => data.position[number].map((at, k) => at + 1e-6 * factor() * data[step.name][number][k]);

function arrows(step) {
  const [x, y, z] = [[], [], []];
  data.position.forEach((at, number) => {
    const end = tip(step, number);
    [x, y, z].forEach((axis, k) => axis.push(at[k], end[k], null));
  });
  // A mark at the end alone says which way an arrow points.
  return {
    type: "scatter3d", mode: "lines+markers", name: step.name, x, y, z, hoverinfo: "skip",
    line: { color: step.color, width: 4, dash: step.dash },
    marker: { color: step.color, symbol: step.tip, size: x.map((_, place) => (place % 3 === 1 ? 3.5 : 0)), line: { width: 0 } },
  };
}

function robot() {
  const [x, y, z] = [0, 1, 2].map((k) => data.outlines[find("pose").value].map((corner) => corner[k]));
  return {
    type: "scatter3d", mode: "lines+markers", name: "robot", x, y, z, hoverinfo: "name",
    line: { color: ink.robot, width: 12 }, marker: { color: ink.robot, size: 4 },
  };
}

function targets() {
  const [x, y, z] = [0, 1, 2].map((k) => data.targets[find("pose").value].map((number) => data.position[number][k]));
  return {
    type: "scatter3d", mode: "markers", name: "targets in this pose", x, y, z, hoverinfo: "name",
    marker: { color: ink.robot, symbol: "circle-open", size: 8 },
  };
}

// All that is drawn in any pose, so that nothing jumps when the robot moves.
function ends() {
  const places = [...data.outlines.flat(), ...data.position];
  for (const step of [BEFORE, AFTER]) data.position.forEach((_, number) => places.push(tip(step, number)));
  return places;
}

function ranges(places) {
  return [0, 1, 2].map((k) => {
    const [low, high] = places.reduce(([a, b], at) => [Math.min(a, at[k]), Math.max(b, at[k])], [Infinity, -Infinity]);
    const margin = Math.max(0.02 * (high - low), 0.01);
    return [low - margin, high + margin];
  });
}

// As far away as it takes to see everything from there, and at a height that leaves as much room above as below.
function fit(direction) {
  const [range, size] = [ranges(ends()), Math.hypot(...direction)];
  const towards = direction.map((value) => value / size);
  const longest = Math.max(...range.map(([low, high]) => high - low));
  const level = Math.hypot(towards[0], towards[1]);
  const right = [-towards[1] / level, towards[0] / level, 0];
  const up = [-towards[2] * right[1], towards[2] * right[0], towards[0] * right[1] - towards[1] * right[0]];
  const along = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const shape = find("robot").clientWidth / (find("robot").clientHeight * (DOMAIN.y[1] - DOMAIN.y[0]));
  const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) =>
    range.map(([low, high], k) => (((corner >> k) % 2 ? 1 : -1) * (high - low)) / 2 / longest));
  let [far, height] = [0, 0];
  // Some rounds: how high the corners are seen depends on how far away they are, and the other way round.
  for (let round = 0; round < 8; round += 1) {
    const seen = corners.map((at) => [at[0], at[1], at[2] - height]);
    far = Math.max(...seen.map((at) => {
      const across = Math.max(Math.abs(along(at, right)) / shape, Math.abs(along(at, up)));
      return along(at, towards) + (BESIDE * across) / HALF_ANGLE;
    }));
    const ups = seen.map((at) => along(at, up) / (far - along(at, towards)));
    height += (up[2] * far * (Math.max(...ups) + Math.min(...ups))) / 2;
  }
  const [x, y, z] = towards.map((value) => far * value);
  return { eye: { x, y, z: z + height }, center: { x: 0, y: 0, z: height } };
}

function drawRobot() {
  find("factor-out").textContent = Number(factor().toPrecision(2)).toLocaleString("en");
  find("pose-out").textContent = data.poses[find("pose").value];
  const range = ranges(ends());
  const spans = range.map(([low, high]) => high - low);
  const longest = Math.max(...spans);
  const axis = { zeroline: false, gridcolor: ink.grid, title: { font: { size: 12 } } };
  const layout = {
    ...sheet(), margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "kept", legend: { orientation: "h", y: 0 },
    scene: {
      domain: DOMAIN, aspectmode: "manual", camera: structuredClone(camera),
      aspectratio: { x: spans[0] / longest, y: spans[1] / longest, z: spans[2] / longest },
      ...Object.fromEntries(["x", "y", "z"].map((name, k) => [
        `${name}axis`, { ...axis, range: range[k], nticks: spans[k] < longest / 2 ? 4 : 8, title: { text: `${name} (m)` } },
      ])),
    },
  };
  Plotly.react("robot", [robot(), targets(), ...chosen(find("which").value).map(arrows)], layout, SETTINGS);
}

function look(at) {
  Object.assign(camera, at);
  Plotly.relayout("robot", { "scene.camera": structuredClone(camera) });
}

function present() {
  // Where the mouse has turned it to.
  const scene = find("robot")._fullLayout && find("robot")._fullLayout.scene;
  return scene && scene._scene ? scene._scene.getCamera() : camera;
}

document.querySelectorAll("[data-view]").forEach((button) =>
  button.addEventListener("click", () => look(fit(VIEWS[button.dataset.view]))));
document.querySelectorAll("[data-turn]").forEach((button) =>
  button.addEventListener("click", () => {
    const [{ eye, center }, angle] = [present(), Number(button.dataset.turn)];
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const [x, y] = [eye.x - center.x, eye.y - center.y];
    look({ eye: { x: center.x + c * x - s * y, y: center.y + s * x + c * y, z: eye.z }, center });
  }));
document.querySelectorAll("[data-zoom]").forEach((button) =>
  button.addEventListener("click", () => {
    const [{ eye, center }, by] = [present(), Number(button.dataset.zoom)];
    const nearer = (name) => center[name] + by * (eye[name] - center[name]);
    look({ eye: { x: nearer("x"), y: nearer("y"), z: nearer("z") }, center });
  }));

// Probabilities of hypotheses.
function drawCauses() {
  if (!data.hypotheses.length) return;
  const rows = data.hypotheses.slice().reverse();
  find("causes").style.height = `${70 + 75 * rows.length}px`;
  // A number stays with its joint.
  const wrapped = (text) => text.replace(/ (?=\d)/g, "\u00a0").replace(/(.{1,34})( |$)/g, "$1<br>").replace(/<br>$/, "");
  Plotly.react("causes", [{
    type: "bar", orientation: "h", x: rows.map((row) => 100 * row.probability), y: rows.map((row) => wrapped(row.name)),
    text: rows.map((row) => row.words), textposition: "auto", textangle: 0, insidetextfont: { color: ink.paper }, marker: { color: AFTER.color }, hoverinfo: "skip",
  }], {
    ...sheet(), margin: { l: 10, r: 10, t: 10, b: 40 },
    xaxis: { title: { text: "posterior probability (%)" }, range: [0, 105], gridcolor: ink.grid },
    yaxis: { automargin: true, tickfont: { size: 12 }, ticks: "outside", ticklen: 6, tickcolor: "rgba(0, 0, 0, 0)" },
  }, SETTINGS);
}

// Any component of the residual against any quantity.
const COMPONENTS = {
  size: ["distance", (off) => Math.hypot(...off)],
  x: ["along x", (off) => off[0]], y: ["along y", (off) => off[1]], z: ["along z", (off) => off[2]],
};

function drawScatter() {
  const [words, of] = COMPONENTS[find("component").value];
  const against = data.against[find("against").value];
  const traces = [];
  const sums = [];
  for (const step of chosen(find("step").value)) {
    const values = data[step.name].map(of);
    const parts = [];
    for (const [held, suffix, symbol] of [[false, " (fitted)", step.symbol], [true, " (validation)", "diamond"]]) {
      const rows = values.map((_, number) => number).filter((number) => data.held_out[number] === held);
      if (!rows.length) continue;
      const root = Math.sqrt(rows.reduce((sum, number) => sum + values[number] ** 2, 0) / rows.length);
      parts.push(`${root < 1000 ? root.toPrecision(3) : root.toFixed(0)} µm${suffix}`);
      traces.push({
        type: "scatter", mode: "markers", name: step.name + suffix, x: rows.map((n) => against.values[n]),
        y: rows.map((n) => values[n]), marker: { color: step.color, symbol, size: 5, opacity: 0.7 },
      });
    }
    sums.push(`${step.name} ${parts.join(" and ")}`);
  }
  const axis = { gridcolor: ink.grid, zerolinecolor: ink.ink };
  Plotly.react("scatter", traces, {
    ...sheet(), margin: { l: 60, r: 10, t: 10, b: 45 }, legend: { orientation: "h", y: 1.02, yanchor: "bottom", itemsizing: "constant" },
    xaxis: { ...axis, title: { text: `${against.name} (${against.unit})` } },
    yaxis: { ...axis, title: { text: `residual, ${words} (µm)` } },
  }, SETTINGS);
  find("scatter-words").textContent = `Root mean square of the single measurements shown, ${words}: ${sums.join("; ")}.`;
}

for (const [key, [words]] of Object.entries(COMPONENTS)) find("component").add(new Option(words, key));
data.against.forEach((entry, number) => find("against").add(new Option(entry.name, number)));
find("pose").max = data.outlines.length - 1;
find("pose").value = 0;
find("factor").value = 50;
// Where nothing was added one of two equal pictures is enough.
if (!data.changed) for (const id of ["which", "step"]) find(id).value = "before";
if (data.outlines.length) Object.assign(camera, fit(VIEWS.corner));
for (const id of ["which", "factor", "pose"]) find(id).addEventListener("input", drawRobot);
for (const id of ["component", "against", "step"]) find(id).addEventListener("input", drawScatter);
function drawAll() {
  takeColours();
  if (data.outlines.length) drawRobot();
  drawCauses();
  drawScatter();
}
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
drawAll();
document.body.dataset.ready = "yes";
