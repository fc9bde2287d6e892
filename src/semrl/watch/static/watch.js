// The live page: shows what the run tells over a web socket, and tells it what a person wants.
// Names come from environments, files and people: they are only ever set as text.
import { colourOf, drawCurve, drawMap, drawScreen } from "./drawing.js";
import { $, fill, make, number, text } from "./page.js";
import { answered, askable, showRules, showTeaching } from "./teaching.js";

const MAX_CURVE = 600;
const PANELS_MS = 100; // nobody reads numbers thirty times a second, and laying them out costs
let about = null, moment = null, between = null, bitmap = null, socket = null, due = false, panels = 0, late = 0;
const curve = new Map(); // number of the moment -> return
const held = new Set();

function connect() {
  const here = new URL("live", location.href);
  here.protocol = "ws:";
  socket = new WebSocket(here);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => (typeof data === "string" ? hear(JSON.parse(data)) : receive(data));
  socket.onclose = () => complain("The run is no longer being watched. Start semrl watch again, and open the address that it prints.", true);
}

function say(name, value) {
  if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ do: name, value }));
}

function hear(message) {
  if (message.type === "about") introduce(message);
  if (answered(message)) return;
  if (message.type === "problem") complain(message.text);
}

async function receive(data) {
  const length = new DataView(data).getUint32(0);
  const message = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const picture = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)]));
  if (bitmap) bitmap.close();
  if (message.type === "between") {
    [between, bitmap] = [message.objects, picture];
    return refresh();
  }
  between = null;
  if (!moment && message.newest === 0 && !matchMedia("(prefers-reduced-motion: reduce)").matches) say("play");
  [moment, bitmap] = [message, picture];
  remember(message);
  refresh();
}

function refresh() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    if (moment && about) show();
  });
}

let quiet = 0;
function complain(text, lasting = false) {
  $("problem").textContent = text;
  $("problem").hidden = false;
  clearTimeout(quiet);
  if (!lasting) quiet = setTimeout(() => ($("problem").hidden = true), 8000);
}

function introduce(run) {
  about = run;
  document.title = `${run.run} · semrl watch`;
  text("run", run.run);
  text("about", `${run.env}, model ${run.model}, ${run.decisions.toLocaleString("en")} decisions learned`);
  fill($("policy"), run.policies.length, () => document.createElement("option"), (option, i) => {
    option.value = option.textContent = run.policies[i];
  });
  $("map-card").hidden = !run.map;
  $("learned-card").hidden = !run.learned.length;
  $("learned").replaceChildren(...run.learned.flatMap(({ name, moved, says }) => [
    make("dt", moved ? `${name}, ${moved}` : name), ...says.map((one) => make("dd", one)),
  ]));
  const keys = run.actions.map((name, i) => `${run.keys[i].map(keyName).join(" + ") || "nothing"}: ${name}`);
  text("keys", `Hold ${keys.join(" · ")}. While no key is held that means something, ${run.keys.some((k) => !k.length) ? "the game waits" : "the other one decides"}. Escape gives the joystick back.`);
  askable(run.words, say);
  text("fact-value", about.unit === 0.01 ? "value, %" : "value");
  refresh();
}

const KEY_NAMES = { " ": "space", ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→", "": "(no key)" };
const keyName = (key) => KEY_NAMES[key] ?? key;

function remember(shown) {
  curve.set(shown.number, shown.return);
  if (curve.size > MAX_CURVE) curve.delete(Math.min(...curve.keys()));
}

// ---- showing -------------------------------------------------------------------------------------------------------

function show() {
  const m = moment;
  drawScreen($("screen"), bitmap, between ? { ...m, objects: between } : m, about, {
    boxes: $("draw-boxes").checked, names: $("draw-names").checked, ways: $("draw-ways").checked, trail: $("draw-trail").checked,
  });
  clearTimeout(late);
  const wait = m.playing ? panels + PANELS_MS - performance.now() : 0;
  if (wait > 0) late = setTimeout(showPanels, wait);
  else showPanels();
}

function showPanels() {
  const m = moment;
  panels = performance.now();
  text("return", number(m.return));
  text("episode", m.episode);
  text("decision", m.decision + (m.over ? " (over)" : ""));
  text("action", m.action ?? "–");
  text("by", m.by ?? "beginning");
  $("by").className = m.by === "person" ? "tag person" : "tag";
  if (m.trouble) complain(m.trouble);
  text("play", m.playing ? "Pause" : "Play");
  $("screen").setAttribute("aria-label", `The game at decision ${m.decision} of episode ${m.episode}, with ${m.objects.length} objects`);
  showControls(m);
  showValues(m.values);
  showPlan(m.plan);
  showCame(m.came);
  showFacts(m.facts);
  $("rules-card").hidden = !m.rules?.length;
  showRules(m.rules ?? []);
  showPlace(m.place);
  showTeaching(m.goal, m.taught, showStrip);
  drawCurve($("curve"), curve, m.number);
  speak(m);
}

function showControls(m) {
  const slider = $("moment");
  slider.min = m.oldest;
  slider.max = m.newest;
  if (document.activeElement !== slider || m.playing) slider.value = m.number;
  text("moment-says", m.number === m.newest ? "newest" : `${m.newest - m.number} back`);
  if (document.activeElement !== $("speed")) $("speed").value = Math.log10(m.speed);
  text("speed-says", `${number(m.speed, 2)} ×`);
  $("person").checked = m.person;
  $("keys").hidden = !m.person;
  if (document.activeElement !== $("policy")) $("policy").value = m.policy;
}

function showValues(values) {
  const all = values?.of ?? [];
  const low = Math.min(0, ...all), high = Math.max(0, ...all), span = high - low || 1;
  fill($("values"), all.length, valueRow, (row, i) => {
    const [name, bar, value] = row.children;
    name.textContent = about.actions[i];
    value.textContent = number(all[i], 3);
    row.className = i === values.best ? "best" : "";
    bar.firstChild.style.left = `${(100 * (Math.min(all[i], 0) - low)) / span}%`;
    bar.firstChild.style.width = `${(100 * Math.abs(all[i])) / span}%`;
  });
}

function valueRow() {
  const bar = make("i", make("u"));
  bar.setAttribute("aria-hidden", "true");
  return make("li", make("span"), bar, make("span"));
}

function showPlan(plan) {
  text("reason", plan ? plan.reason : "There is no plan: this model has no planner, or has not learned to predict yet.");
  const scenarios = plan?.scenarios ?? [];
  fill($("scenarios"), scenarios.length, () => {
    const strip = make("div");
    strip.className = "strip";
    const head = make("div", make("span"), make("span"));
    head.className = "head";
    return make("li", head, strip);
  }, (row, i) => {
    const { actions, rewards, uncertainty } = scenarios[i];
    const [head, strip] = row.children;
    head.children[0].textContent = `scenario ${i + 1}`;
    head.children[1].textContent = `return ${number(scenarios[i].return, 3)}${uncertainty === null ? "" : ` ± ${number(uncertainty, 2)}`}`;
    showStrip(strip, actions.map((action, j) => ({ action, reward: rewards[j] })));
  });
}

function showStrip(strip, decisions) {
  fill(strip, decisions.length, () => make("span"), (cell, i) => {
    const { action, reward, by } = decisions[i];
    cell.textContent = short(action);
    cell.title = `${action}${reward ? `, reward ${number(reward, 2)}` : ""}${by ? `, by ${by}` : ""}`;
    cell.className = `${reward > 0 ? "gain" : reward < 0 ? "loss" : ""} ${by === "person" ? "mine" : ""}`;
    cell.style.setProperty("--of", colourOf(about.actions.indexOf(action)));
  });
}

const WORDS = /NOOP|UP|DOWN|LEFT|RIGHT|FIRE/g; // of directions and buttons the first letter is enough
const short = (name) => (name === "NOOP" ? "·" : name.replace(WORDS, (word) => word[0]).slice(0, 3));

function showCame({ decisions, miss }) {
  showStrip($("came"), decisions);
  $("came").setAttribute("aria-label", `The last ${decisions.length} decisions, the newest at the end`);
  const rewards = decisions.filter((d) => d.reward).map((d) => `${d.reward > 0 ? "+" : ""}${number(d.reward)} at decision ${d.decision}`);
  const seen = miss === null ? "" : miss < 0.5 ? " This state is as it was imagined." : ` The number that was imagined worst is off by ${number(miss, 1)}.`;
  text("came-says", (rewards.length ? `Rewards: ${rewards.join(", ")}.` : "No reward lately.") + seen);
}

function showFacts(facts) {
  $("no-facts").hidden = facts.length > 0;
  $("facts").parentElement.hidden = !facts.length;
  fill($("facts"), facts.length, () => {
    const head = make("th");
    head.scope = "row";
    return make("tr", head, make("td"), make("td"));
  }, (row, i) => {
    const [name, value, change] = row.children;
    name.textContent = facts[i].name;
    value.textContent = typeof facts[i].value === "boolean" ? (facts[i].value ? "yes" : "no") : number(facts[i].value, 2);
    change.textContent = facts[i].change ? `${facts[i].change > 0 ? "+" : ""}${number(facts[i].change, 2)}` : "";
    change.className = facts[i].change ? "moves" : "";
  });
}

function showPlace(place) {
  if (!about.map) return;
  drawMap($("map"), about.map, place);
  const all = `${about.map.nodes_in_all.toLocaleString("en")} nodes, ${about.map.edges_in_all.toLocaleString("en")} edges.`;
  if (!place) return text("place", all);
  const [end, begins] = place.to === "goal" ? ["the goal", "The goal lies"] : ["a gain", "The nearest gain begins"];
  const way = place.cost === null ? `No way to ${end} is known from here.` : place.path.length < 2 ? `${begins} here.` : `${begins} ${place.path.length - 1} steps away, at a cost of ${number(place.cost)}.`;
  text("place", `${way} ${all}`);
}

let spoken = 0;
function speak(m) { // for those who hear the page: now and then, and what matters at once
  const now = performance.now();
  if (!m.reward && !m.over && (m.playing ? now - spoken < 10000 : $("spoken").dataset.number === String(m.number))) return;
  spoken = now;
  $("spoken").dataset.number = m.number;
  text("spoken", `Decision ${m.decision}, ${m.action ?? "beginning"}, ${m.reward ? `reward ${number(m.reward)}, ` : ""}return ${number(m.return)}${m.over ? ", the episode is over" : ""}`);
}

// ---- obeying -------------------------------------------------------------------------------------------------------

for (const [id, command] of [["back", "back"], ["step", "step"], ["newest", "newest"], ["new-episode", "episode"]]) {
  $(id).onclick = () => say(command);
}
$("play").onclick = () => say(moment?.playing ? "pause" : "play");
$("moment").oninput = () => say("show", Number($("moment").value));
$("speed").oninput = () => {
  const speed = 10 ** Number($("speed").value);
  say("speed", Math.min(20, Math.max(0.1, Number(speed.toPrecision(2)))));
};
$("policy").onchange = () => say("policy", $("policy").value);
$("person").onchange = () => {
  held.clear();
  say("person", $("person").checked);
  $("person").blur(); // its keys are the game's now
};
for (const id of ["speed", "moment", "policy"]) {
  $(id).addEventListener("change", () => moment?.person && $(id).blur());
}
for (const id of ["draw-boxes", "draw-names", "draw-ways", "draw-trail"]) $(id).onchange = refresh;

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || !moment) return;
  if (moment.person) return press(event);
  if (event.target.matches("input, select, button, a")) return;
  const command = { ",": "back", ".": "step", k: moment.playing ? "pause" : "play" }[event.key];
  if (command) say(command);
});

function press(event) {
  if (event.key === "Escape") return say("person", false);
  if (event.target.matches("input, select") || !about.keys.flat().includes(event.key)) return;
  event.preventDefault();
  if (!held.has(event.key)) {
    held.add(event.key);
    say("hold", [...held]);
  }
}

document.addEventListener("keyup", (event) => {
  if (!held.delete(event.key)) return;
  event.preventDefault();
  say("hold", [...held]);
});
window.addEventListener("blur", () => {
  if (held.size) say("hold", []);
  held.clear();
});
window.addEventListener("resize", refresh);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", refresh);

connect();
