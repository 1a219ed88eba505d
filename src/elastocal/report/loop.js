"use strict";
// Draws the page of a campaign from the JSON that stands in it; marks and dashes tell before from after without colour, too.
const data = JSON.parse(document.getElementById("data").textContent);
const find = (id) => document.getElementById(id);
const STEPS = [{ name: "before", dash: [], mark: "dot" }, { name: "after", dash: [5, 3], mark: "diamond" }];
const chosen = (value) => STEPS.filter((step) => value === "both" || value === step.name);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// Colours are those of the page, which has a light and a dark set.
const ink = {};
function takeColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["paper", "ink", "grid", "link", "joint", "before", "after"]) ink[name] = style.getPropertyValue(`--${name}`).trim();
  for (const step of STEPS) step.color = ink[step.name];
}

// A canvas at the resolution of the screen, empty.
function emptied(canvas) {
  const [width, height, fine] = [canvas.clientWidth, canvas.clientHeight, window.devicePixelRatio || 1];
  canvas.width = Math.round(width * fine);
  canvas.height = Math.round(height * fine);
  const pen = canvas.getContext("2d");
  pen.scale(fine, fine);
  pen.fillStyle = ink.paper;
  pen.fillRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  return { pen, width, height };
}

function line(pen, from, to, color, width, { dash = [], cap = "butt" } = {}) {
  Object.assign(pen, { strokeStyle: color, lineWidth: width, lineCap: cap });
  pen.setLineDash(dash);
  pen.beginPath();
  pen.moveTo(from[0], from[1]);
  pen.lineTo(to[0], to[1]);
  pen.stroke();
  pen.setLineDash([]);
}

function mark(pen, [x, y], kind, color, size, filled = true) {
  Object.assign(pen, { strokeStyle: color, fillStyle: color, lineWidth: 1.3 });
  pen.beginPath();
  if (kind === "dot") pen.arc(x, y, size, 0, 2 * Math.PI);
  else if (kind === "cross") for (const s of [-1, 1]) { pen.moveTo(x - size, y - s * size); pen.lineTo(x + size, y + s * size); }
  else { pen.moveTo(x, y - 1.3 * size); pen.lineTo(x + 1.3 * size, y); pen.lineTo(x, y + 1.3 * size); pen.lineTo(x - 1.3 * size, y); pen.closePath(); }
  if (filled && kind !== "cross") pen.fill(); else pen.stroke();
}

// The robot in space, seen without perspective from a direction.
const VIEWS = { corner: [-0.8, 0.35], front: [0, 0.05], side: [-Math.PI / 2, 0.05], above: [-Math.PI / 2, Math.PI / 2] };
const view = { yaw: VIEWS.corner[0], pitch: VIEWS.corner[1], zoom: 1 };
const MARGIN = 24;

// From one tenth to ten times the factor at which arrows of the middle length are well seen.
const factor = () => data.usual_factor * 10 ** ((find("factor").value - 50) / 50);
const tip = (step, number) => data.position[number].map((at, k) => at + 1e-6 * factor() * data[step.name][number][k]);

function projection(width, height) {
  const [cy, sy, cp, sp] = [Math.cos(view.yaw), Math.sin(view.yaw), Math.cos(view.pitch), Math.sin(view.pitch)];
  const [right, up, towards] = [[-sy, cy, 0], [-sp * cy, -sp * sy, cp], [cp * cy, cp * sy, sp]];
  // All that is drawn in any pose lies in sight, so that nothing jumps when the robot moves.
  const ends = [...data.outlines.flat(), ...data.position];
  for (const step of STEPS) data.position.forEach((_, number) => ends.push(tip(step, number)));
  const spans = [right, up].map((axis) => ends.reduce(([low, high], at) => {
    const value = dot(axis, at);
    return [Math.min(low, value), Math.max(high, value)];
  }, [Infinity, -Infinity]));
  const [wide, tall] = spans.map(([low, high]) => Math.max(high - low, 1e-6));
  const scale = view.zoom * Math.min((width - 2 * MARGIN) / wide, (height - 2 * MARGIN) / tall);
  const [x0, y0] = spans.map(([low, high]) => (low + high) / 2);
  const shown = (at) => [width / 2 + scale * (dot(right, at) - x0), height / 2 - scale * (dot(up, at) - y0), dot(towards, at)];
  return { shown, scale, ends };
}

function floor(pen, shown, ends) {
  const reach = Math.max(...ends.map((at) => Math.max(Math.abs(at[0]), Math.abs(at[1]))));
  const step = reach > 1.5 ? 1 : 0.25;
  const last = Math.ceil(reach / step);
  for (let k = -last; k <= last; k += 1) {
    for (const swap of [false, true]) {
      const [from, to] = [-last, last].map((end) => (swap ? [k * step, end * step, 0] : [end * step, k * step, 0]));
      line(pen, shown(from), shown(to), ink.grid, 1);
    }
  }
  pen.fillStyle = ink.ink;
  for (const [k, name] of ["x", "y", "z"].entries()) {
    const end = [0, 1, 2].map((axis) => (axis === k ? 0.35 * Math.min(reach, 2) : 0));
    line(pen, shown([0, 0, 0]), shown(end), ink.ink, 1.5);
    pen.fillText(name, shown(end)[0] + 4, shown(end)[1] - 4);
  }
  return step;
}

function drawRobot() {
  const pose = find("pose").value;
  find("factor-out").textContent = Number(factor().toPrecision(2)).toLocaleString("en");
  find("pose-out").textContent = data.poses[pose];
  const { pen, width, height } = emptied(find("robot"));
  const { shown, scale, ends } = projection(width, height);
  const step = floor(pen, shown, ends);
  const things = [];
  const outline = data.outlines[pose].map(shown);
  const thick = Math.min(Math.max(0.15 * scale, 7), 34);
  for (let k = 1; k < outline.length; k += 1) {
    const [from, to, size] = [outline[k - 1], outline[k], thick * (1 - (0.5 * k) / outline.length)];
    things.push([(from[2] + to[2]) / 2, () => {
      line(pen, from, to, ink.joint, size + 2, { cap: "round" });
      line(pen, from, to, ink.link, size, { cap: "round" });
    }]);
  }
  data.joints[pose].forEach(([at, axis], k) => {
    const size = thick * (1.15 - (0.5 * k) / data.joints[pose].length);
    const ends_of = [-1, 1].map((sign) => shown(at.map((value, i) => value + (sign * 0.75 * size * axis[i]) / scale)));
    // In front of the links that meet there.
    things.push([shown(at)[2] + thick / scale, () => {
      mark(pen, shown(at), "dot", ink.joint, 0.55 * size);
      line(pen, ...ends_of, ink.joint, 1.1 * size);
    }]);
  });
  for (const each of chosen(find("which").value)) {
    data.position.forEach((at, number) => {
      if (find("shown").value === "held" && !data.held_out[number]) return;
      const [from, to] = [shown(at), shown(tip(each, number))];
      things.push([to[2], () => {
        line(pen, from, to, each.color, 1.8, { dash: each.dash });
        mark(pen, to, each.mark, each.color, 2.2);
      }]);
    });
  }
  for (const number of data.targets[pose]) things.push([Infinity, () => mark(pen, shown(data.position[number]), "dot", ink.ink, 8, false)]);
  things.sort((a, b) => a[0] - b[0]).forEach(([, draw]) => draw());
  find("grid-out").textContent = `Lines on the floor are ${step} m apart.`;
}

function turn(yaw, pitch, zoom = 1) {
  view.yaw += yaw;
  view.pitch = Math.min(Math.max(view.pitch + pitch, -Math.PI / 2), Math.PI / 2);
  view.zoom = Math.min(Math.max(view.zoom * zoom, 0.2), 20);
  drawRobot();
}
const on = (selector, act) => document.querySelectorAll(selector).forEach((button) => button.addEventListener("click", () => act(button.dataset)));
on("[data-view]", ({ view: name }) => { [view.yaw, view.pitch] = VIEWS[name]; view.zoom = 1; drawRobot(); });
on("[data-turn]", ({ turn: by }) => turn(Number(by), 0));
on("[data-tilt]", ({ tilt: by }) => turn(0, Number(by)));
on("[data-zoom]", ({ zoom: by }) => turn(0, 0, Number(by)));
on("[data-worst]", () => { find("pose").value = data.worst; drawRobot(); });
const KEYS = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1], "+": [0, 0, 1.25], "-": [0, 0, 0.8] };
find("robot").addEventListener("keydown", (event) => {
  if (KEYS[event.key]) { event.preventDefault(); turn(...KEYS[event.key]); }
});
find("robot").addEventListener("pointermove", (event) => {
  if (event.buttons) turn(-0.008 * event.movementX, 0.008 * event.movementY);
});
// The wheel alone moves the page.
find("robot").addEventListener("wheel", (event) => {
  if (event.ctrlKey) { event.preventDefault(); turn(0, 0, Math.exp(-0.002 * event.deltaY)); }
}, { passive: false });

// Any component of the residual against any quantity.
const COMPONENTS = {
  size: ["distance", (off) => Math.hypot(...off)],
  x: ["along x", (off) => off[0]], y: ["along y", (off) => off[1]], z: ["along z", (off) => off[2]],
};

function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((each) => each * power >= rough) * power;
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, k) => Number(((first + k) * step).toPrecision(12)));
}

function drawScatter() {
  const [words, of] = COMPONENTS[find("component").value];
  const against = data.against[find("against").value];
  const [series, sums] = [[], []];
  for (const step of chosen(find("step").value)) {
    const values = data[step.name].map(of);
    const parts = [];
    for (const [held, suffix, kind, filled] of [[false, "fitted", step.mark, step.name === "after"], [true, "validation", "cross", true]]) {
      const rows = values.map((_, number) => number).filter((number) => data.held_out[number] === held);
      if (!rows.length) continue;
      const root = Math.sqrt(rows.reduce((sum, number) => sum + values[number] ** 2, 0) / rows.length);
      parts.push(`${root < 1000 ? root.toPrecision(3) : root.toFixed(0)} µm (${suffix})`);
      series.push({ name: `${step.name} (${suffix})`, kind, filled, color: step.color, points: rows.map((n) => [against.values[n], values[n]]) });
    }
    sums.push(`${step.name} ${parts.join(" and ")}`);
  }
  find("scatter-words").textContent = `Root mean square of the single measurements shown, ${words}: ${sums.join("; ")}.`;
  const { pen, width, height } = emptied(find("scatter"));
  const box = { left: 64, right: width - 12, top: 30, bottom: height - 44 };
  const spans = [0, 1].map((k) => {
    const all = series.flatMap(({ points }) => points.map((point) => point[k]));
    const [low, high] = [Math.min(...(k ? [0] : []), ...all), Math.max(...(k ? [0] : []), ...all)];
    const room = 0.04 * (high - low) || 1;
    return [low - room, high + room];
  });
  const across = (value) => box.left + ((value - spans[0][0]) / (spans[0][1] - spans[0][0])) * (box.right - box.left);
  const up = (value) => box.bottom - ((value - spans[1][0]) / (spans[1][1] - spans[1][0])) * (box.bottom - box.top);
  pen.fillStyle = ink.ink;
  pen.textAlign = "center";
  for (const value of ticks(...spans[0], width / 90)) {
    line(pen, [across(value), box.top], [across(value), box.bottom], ink.grid, 1);
    pen.fillText(value.toLocaleString("en"), across(value), box.bottom + 16);
  }
  pen.fillText(`${against.name} (${against.unit})`, (box.left + box.right) / 2, box.bottom + 36);
  pen.textAlign = "right";
  for (const value of ticks(...spans[1], 6)) {
    line(pen, [box.left, up(value)], [box.right, up(value)], value ? ink.grid : ink.ink, 1);
    pen.fillText(value.toLocaleString("en"), box.left - 6, up(value) + 4);
  }
  pen.save();
  pen.translate(12, (box.top + box.bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.textAlign = "center";
  pen.fillText(`residual, ${words} (µm)`, 0, 0);
  pen.restore();
  pen.globalAlpha = 0.75;
  for (const { kind, filled, color, points } of series) for (const [x, y] of points) mark(pen, [across(x), up(y)], kind, color, 2.6, filled);
  pen.globalAlpha = 1;
  find("scatter-legend").replaceChildren(...series.map(({ name, kind, filled, color }) => {
    const [item, sample] = [document.createElement("li"), document.createElement("canvas")];
    Object.assign(sample, { width: 14, height: 14 });
    mark(sample.getContext("2d"), [7, 7], kind, color, 4, filled);
    item.append(sample, ` ${name}`);
    return item;
  }));
}

for (const [key, [words]] of Object.entries(COMPONENTS)) find("component").add(new Option(words, key));
data.against.forEach((entry, number) => find("against").add(new Option(entry.name, number)));
find("pose").max = data.outlines.length - 1;
find("pose").value = data.worst;
find("factor").value = 50;
// Where nothing was added one of two equal pictures is enough.
if (!data.changed) for (const id of ["which", "step"]) find(id).value = "before";
// All measurements at once hide each other; without validation poses there is nothing else to show.
if (!data.held_out.some(Boolean)) find("shown").value = "all";
for (const id of ["which", "shown", "factor", "pose"]) find(id).addEventListener("input", drawRobot);
for (const id of ["component", "against", "step"]) find(id).addEventListener("input", drawScatter);
function drawAll() {
  takeColours();
  drawRobot();
  if (data.against.length) drawScatter();
}
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
window.addEventListener("resize", drawAll);
// On paper the page is light.
for (const [event, light] of [["beforeprint", true], ["afterprint", false]]) {
  window.addEventListener(event, () => { document.documentElement.classList.toggle("light", light); drawAll(); });
}
drawAll();
document.body.dataset.ready = "yes";
