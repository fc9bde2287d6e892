// What is drawn on the three canvases.

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const LIGHT = "#e9edf3", PAST = "#ffb454";
const ACTIONS = ["#3b8eea", "#f2a93b", "#35b779", "#e8575a", "#a77bdc", "#3fc1c9", "#f178b6", "#c9c94a"];

export const colourOf = (action) => ACTIONS[Math.max(action, 0) % ACTIONS.length];

function fitted(canvas, height) { // as many pixels as the screen has
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const [w, h] = [Math.round(width * ratio), Math.round((height ?? canvas.clientHeight) * ratio)];
  if (canvas.width !== w) canvas.width = w;
  if (canvas.height !== h) canvas.height = h;
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, w, h);
  return [pen, width, h / ratio];
}

export function drawScreen(canvas, bitmap, moment, about, wanted) {
  const most = Math.max(240, window.innerHeight * (window.innerWidth > 768 ? 0.47 : 0.56));
  const height = Math.min((canvas.clientWidth * bitmap.height) / bitmap.width, most);
  if (Math.abs(canvas.clientHeight - height) > 1) canvas.style.height = `${height}px`;
  const [pen, full] = fitted(canvas, height);
  const width = (height * bitmap.width) / bitmap.height;
  pen.translate((full - width) / 2, 0);
  pen.imageSmoothingEnabled = bitmap.width > width;
  pen.drawImage(bitmap, 0, 0, width, height);
  if (wanted.trail) moment.trail.forEach((way) => drawWay(pen, way, width, height, PAST, 1.5));
  if (wanted.ways) moment.ways.forEach((way) => drawWay(pen, way, width, height, LIGHT, 2));
  if (wanted.boxes) moment.objects.forEach((object) => drawBox(pen, object, width, height, about, wanted.names));
}

function drawWay(pen, way, width, height, colour, dot) {
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = 1;
  pen.globalAlpha = 0.9;
  pen.beginPath();
  way.forEach(([x, y]) => pen.lineTo(x * width, y * height));
  pen.stroke();
  for (const [x, y] of way) {
    pen.beginPath();
    pen.arc(x * width, y * height, dot, 0, 7);
    pen.fill();
  }
  pen.globalAlpha = 1;
}

function drawBox(pen, { box, kind, name }, width, height, about, named) {
  const [left, top, w, h] = [box[0] * width, box[1] * height, box[2] * width, box[3] * height];
  const colour = `rgb(${about.colours[(kind ?? 0) % about.colours.length].join(",")})`;
  pen.strokeStyle = colour;
  pen.lineWidth = 2;
  pen.strokeRect(left - 1, top - 1, w + 2, h + 2);
  if (!named || !name) return;
  pen.font = "600 12px system-ui, sans-serif";
  const shown = name.length > 32 ? `${name.slice(0, 31)}…` : name;
  const wide = pen.measureText(shown).width;
  const x = left + w + 6 + wide > width ? left - wide - 6 : left + w + 6;
  const y = Math.min(Math.max(top + h / 2 + 4, 12), height - 4);
  pen.lineWidth = 3;
  pen.strokeStyle = "rgba(0, 0, 0, .75)";
  pen.strokeText(shown, x, y);
  pen.fillStyle = LIGHT;
  pen.fillText(shown, x, y);
}

let drawn = { key: "", layer: null }; // the map without where we are: drawn once for a size and a scheme

function mapLayer(canvas, map, width, height) {
  const key = [canvas.width, canvas.height, css("--chart")].join();
  if (drawn.key === key) return drawn.layer;
  const layer = new OffscreenCanvas(canvas.width, canvas.height);
  const pen = layer.getContext("2d");
  const ratio = window.devicePixelRatio || 1;
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.strokeStyle = css("--faint");
  pen.globalAlpha = 0.35;
  line(pen, map, map.edges, width, height);
  pen.globalAlpha = 1;
  const [plain, gain] = [css("--chart"), css("--gain")];
  map.node.forEach((_, i) => dot(pen, at(map, i, width, height), map.gain[i] ? gain : plain, map.gain[i] ? 3 : 1.6));
  drawn = { key, layer };
  return layer;
}

const at = (map, i, width, height) => [8 + map.x[i] * (width - 16), 8 + map.y[i] * (height - 16)];

function line(pen, map, ends, width, height) {
  pen.beginPath();
  for (const [a, b] of ends) {
    pen.moveTo(...at(map, a, width, height));
    pen.lineTo(...at(map, b, width, height));
  }
  pen.stroke();
}

function dot(pen, place, colour, size) {
  pen.fillStyle = colour;
  pen.beginPath();
  pen.arc(...place, size, 0, 7);
  pen.fill();
}

export function drawMap(canvas, map, place) {
  const [pen, width, height] = fitted(canvas);
  pen.drawImage(mapLayer(canvas, map, width, height), 0, 0, width, height);
  if (!place) return;
  const where = new Map(map.node.map((node, i) => [node, i]));
  const path = place.path.map((node) => where.get(node)).filter((i) => i !== undefined);
  const accent = css("--accent");
  pen.strokeStyle = accent;
  pen.lineWidth = 2;
  line(pen, map, path.slice(1).map((b, i) => [path[i], b]), width, height);
  const here = where.get(place.node);
  if (here === undefined) return;
  dot(pen, at(map, here, width, height), accent, 6);
  pen.strokeStyle = css("--card");
  pen.stroke();
}

export function drawCurve(canvas, curve, now) {
  const [pen, width, height] = fitted(canvas, 90);
  const points = [...curve].sort(([a], [b]) => a - b);
  if (points.length < 2) return;
  const values = points.map(([, value]) => value);
  const low = Math.min(...values), high = Math.max(...values);
  const first = points[0][0], last = points.at(-1)[0];
  const x = (n) => 34 + ((n - first) / (last - first || 1)) * (width - 42);
  const y = (v) => (high > low ? 10 + ((high - v) / (high - low)) * (height - 22) : height / 2);
  pen.fillStyle = css("--soft");
  pen.font = "11px system-ui, sans-serif";
  for (const value of new Set([low, high])) pen.fillText(String(Math.round(value * 100) / 100).replace("-", "−"), 2, y(value) + 4);
  pen.strokeStyle = css("--accent");
  pen.lineWidth = 1.5;
  pen.beginPath();
  points.forEach(([n, v], i) => {
    if (i && v !== points[i - 1][1]) pen.lineTo(x(n), y(points[i - 1][1])); // returns go in steps
    pen.lineTo(x(n), y(v));
  });
  pen.stroke();
  if (!curve.has(now)) return;
  pen.fillStyle = css("--accent");
  pen.beginPath();
  pen.arc(x(now), y(curve.get(now)), 3.5, 0, 7);
  pen.fill();
}
