"use strict";
// Draws the page of a campaign from the JSON that stands in it; colours and dashes tell before from after without colour, too.
const data = JSON.parse(document.getElementById("data").textContent);
const BEFORE = { name: "before", dash: "solid", symbol: "circle-open" };
const AFTER = { name: "after", dash: "dash", symbol: "cross" };
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
const eye = { x: 0.95, y: -0.95, z: 0.45 };
const VIEWS = { front: [1.5, 0, 0.15], side: [0, -1.5, 0.15], above: [0.01, 0, 1.7] };

function factor() {
  // From one tenth to ten times the factor at which arrows of the middle length are well seen.
  return data.usual_factor * 10 ** ((find("factor").value - 50) / 50);
}

function arrows(step) {
  const [x, y, z] = [[], [], []];
  data.position.forEach((at, number) => {
    const off = data[step.name][number];
    [x, y, z].forEach((axis, k) => axis.push(at[k], at[k] + 1e-6 * factor() * off[k], null));
  });
  return {
    type: "scatter3d", mode: "lines", name: step.name, x, y, z, hoverinfo: "skip",
    line: { color: step.color, width: 4, dash: step.dash },
  };
}

function robot() {
  const [x, y, z] = [0, 1, 2].map((k) => data.outlines[find("pose").value].map((corner) => corner[k]));
  return {
    type: "scatter3d", mode: "lines+markers", name: "robot", x, y, z, hoverinfo: "name",
    line: { color: ink.robot, width: 12 }, marker: { color: ink.robot, size: 4 },
  };
}

function drawRobot() {
  find("factor-out").textContent = Number(factor().toPrecision(2)).toLocaleString("en");
  find("pose-out").textContent = data.poses[find("pose").value];
  const axis = { zeroline: false, gridcolor: ink.grid, title: { font: { size: 12 } } };
  const layout = {
    ...sheet(), margin: { l: 0, r: 0, t: 0, b: 0 }, uirevision: "kept", legend: { orientation: "h", y: 0 },
    scene: {
      aspectmode: "data", camera: { eye: { ...eye } }, xaxis: { ...axis, title: { text: "x (m)" } },
      yaxis: { ...axis, title: { text: "y (m)" } }, zaxis: { ...axis, title: { text: "z (m)" } },
    },
  };
  Plotly.react("robot", [robot(), ...chosen(find("which").value).map(arrows)], layout, SETTINGS);
}

function look(x, y, z) {
  Object.assign(eye, { x, y, z });
  Plotly.relayout("robot", { "scene.camera.eye": { ...eye } });
}

function present() {
  // Where the mouse has turned it to.
  const scene = find("robot")._fullLayout && find("robot")._fullLayout.scene;
  return scene && scene._scene ? scene._scene.getCamera().eye : eye;
}

document.querySelectorAll("[data-view]").forEach((button) =>
  button.addEventListener("click", () => look(...VIEWS[button.dataset.view])));
document.querySelectorAll("[data-turn]").forEach((button) =>
  button.addEventListener("click", () => {
    const [at, angle] = [present(), Number(button.dataset.turn)];
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    look(c * at.x - s * at.y, s * at.x + c * at.y, at.z);
  }));
document.querySelectorAll("[data-zoom]").forEach((button) =>
  button.addEventListener("click", () => {
    const [at, by] = [present(), Number(button.dataset.zoom)];
    look(by * at.x, by * at.y, by * at.z);
  }));

// Probabilities of hypotheses.
function drawCauses() {
  if (!data.hypotheses.length) return;
  const rows = data.hypotheses.slice().reverse();
  // A number stays with its joint.
  const wrapped = (text) => text.replace(/ (?=\d)/g, "\u00a0").replace(/(.{1,34})( |$)/g, "$1<br>").replace(/<br>$/, "");
  Plotly.react("causes", [{
    type: "bar", orientation: "h", x: rows.map((row) => 100 * row.probability), y: rows.map((row) => wrapped(row.name)),
    text: rows.map((row) => row.words), textposition: "auto", marker: { color: AFTER.color }, hoverinfo: "skip",
  }], {
    ...sheet(), margin: { l: 10, r: 10, t: 10, b: 40 },
    xaxis: { title: { text: "posterior probability (%)" }, range: [0, 105], gridcolor: ink.grid },
    yaxis: { automargin: true, tickfont: { size: 12 } },
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
    const root = Math.sqrt(values.reduce((sum, value) => sum + value * value, 0) / values.length);
    sums.push(`${step.name} ${root.toPrecision(3)} µm`);
    for (const [held, suffix, symbol] of [[false, ", fitted", step.symbol], [true, ", validation", "diamond"]]) {
      const rows = values.map((_, number) => number).filter((number) => data.held_out[number] === held);
      traces.push({
        type: "scatter", mode: "markers", name: step.name + suffix, x: rows.map((n) => against.values[n]),
        y: rows.map((n) => values[n]), marker: { color: step.color, symbol, size: 5, opacity: 0.7 },
      });
    }
  }
  const axis = { gridcolor: ink.grid, zerolinecolor: ink.ink };
  Plotly.react("scatter", traces, {
    ...sheet(), margin: { l: 60, r: 10, t: 10, b: 45 }, legend: { orientation: "h", y: 1.12 },
    xaxis: { ...axis, title: { text: `${against.name} (${against.unit})` } },
    yaxis: { ...axis, title: { text: `residual, ${words} (µm)` } },
  }, SETTINGS);
  find("scatter-words").textContent = `Root mean square, ${words}: ${sums.join(", ")}.`;
}

for (const [key, [words]] of Object.entries(COMPONENTS)) find("component").add(new Option(words, key));
data.against.forEach((entry, number) => find("against").add(new Option(entry.name, number)));
find("pose").max = data.outlines.length - 1;
find("pose").value = 0;
find("factor").value = 50;
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
