// The goal that a person types, and what they add to the run: classes, facts, what is forbidden, and the record of it.
import { $, fill, make, number, text } from "./page.js";

let say = () => {};
let asked = ""; // the form whose answer is awaited
let can = false; // whether anything can be added

export function askable(words, sayIt) { // once, when it is known what can be said of the run
  say = sayIt;
  can = !words.trouble;
  for (const id of ["goal-card", "taught-card"]) {
    for (const part of $(id).querySelectorAll("input, button")) part.disabled = !can;
  }
  if (!can) return text("words", `Nothing can be asked or added: ${words.trouble}.`);
  $("goal").placeholder = words.example;
  $("class-is").placeholder = words.example;
  const lists = [["classes", words.classes], ["numbers", words.numbers], ["roles", words.roles], ["individuals", words.individuals]];
  text("words", lists.filter(([, all]) => all.length).map(([what, all]) => `${what}: ${all.join(", ")}`).join(" · "));
}

export function answered(message) { // returns whether it was an answer to one of these forms
  const problem = { goal: "goal-problem", edit: `${asked || "undo"}-problem` }[message.about];
  if (!problem) return false;
  const wrong = message.type === "problem";
  text(problem, wrong ? message.text : "");
  $(problem).hidden = !wrong;
  for (const input of $(problem).closest("form")?.querySelectorAll("input[type=text]") ?? []) {
    input.toggleAttribute("aria-invalid", wrong);
    if (!wrong && message.about === "edit") input.value = "";
  }
  return true;
}

export function showTeaching(goal, taught, showStrip) {
  $("goal-now").hidden = !goal;
  $("goal-drop").hidden = !goal;
  if (goal) showGoal(goal);
  $("no-classes").hidden = taught.classes.length > 0;
  fill($("classes"), taught.classes.length, switchRow, (row, i) => showClass(row, taught.classes[i]));
  fill($("edits"), taught.edits.length, () => make("li"), (row, i) => {
    if (row.textContent !== taught.edits[i]) row.textContent = taught.edits[i];
  });
  text("edits-says", taught.edits_in_all ? `${taught.edits_in_all === 1 ? "One edit stands" : `${taught.edits_in_all} edits stand`}, the newest last.` : "Nothing was added yet.");
  $("undo").hidden = !taught.edits_in_all;
  $("changed").hidden = !taught.changed;
  if (!taught.changed) return;
  const { by, before, after } = taught.changed;
  const same = before.join() === after.join();
  text("changed-says", same ? `The plan is the same with: ${by}` : `What the plan became with: ${by}`);
  for (const [id, actions] of [["plan-before", before], ["plan-after", after]]) {
    showStrip($(id), actions.map((action) => ({ action, reward: 0 })));
    $(id).setAttribute("aria-label", `${id === "plan-before" ? "Before" : "Now"}: ${actions.join(", ") || "no plan"}`);
  }
}

function showGoal({ goal, state, decisions, done, ahead, distance }) {
  text("goal-text", goal);
  $("goal-text").hidden = goal === $("goal").value;
  $("goal-done").value = done;
  const far = distance === null ? "" : distance === 0 ? " Its best plan meets what is sought next." : ` Its best plan stays ${number(distance, 1)} % of the image from what is sought next.`;
  const says = {
    sought: `Sought for ${count(decisions, "decision")}.${ahead === null ? far : ` The plan reaches it in ${count(ahead, "decision")}.`}`,
    reached: `Reached after ${count(decisions, "decision")}.`,
    lost: "Lost in this episode: something was not kept that must be. It is sought anew in the next one.",
  }[state];
  text("goal-says", says);
  $("goal-now").dataset.state = state;
  if ($("goal-spoken").dataset.state !== state + goal) { // for those who hear the page
    $("goal-spoken").dataset.state = state + goal;
    text("goal-spoken", `Goal ${goal}: ${state}`);
  }
}

const count = (n, what) => `${n.toLocaleString("en")} ${what}${n === 1 ? "" : "s"}`;

function switchRow() {
  const box = make("input");
  box.type = "checkbox";
  box.onchange = () => edit("undo", { class: box.dataset.name, on: box.checked });
  return make("li", make("label", box, make("b"), make("span")), make("span"));
}

function showSwitch(box, name, on) {
  box.dataset.name = name;
  box.disabled = !can;
  if (document.activeElement !== box) box.checked = on;
}

export function showRules(rules) {
  fill($("rules"), rules.length, switchRow, (row, i) => {
    const { name, about, says, on } = rules[i];
    const [box, head, is] = row.children[0].children;
    if (box.dataset.name !== name) box.blur(); // another rule stands here now
    showSwitch(box, name, on);
    head.textContent = about;
    is.textContent = ` ${says}`;
    row.children[1].textContent = on ? "" : "off";
    row.className = on ? "" : "off";
  });
}

function showClass(row, { name, condition, comment, forbidden, on, holds }) {
  const [label, tag] = row.children;
  const [box, head, is] = label.children;
  showSwitch(box, name, on);
  if (head.textContent !== name) head.textContent = name;
  is.textContent = ` ${condition}${comment ? ` – ${comment}` : ""}`;
  const now = Array.isArray(holds) ? holds.join(", ") : holds ? "holds now" : "";
  tag.textContent = [forbidden ? "forbidden" : "", on ? now : "off"].filter(Boolean).join(" · ");
  row.className = `${on ? "" : "off"} ${forbidden && holds === true ? "entered" : ""}`;
}

function edit(form, value) {
  asked = form;
  say("edit", value);
}

$("goal-form").onsubmit = (event) => {
  event.preventDefault();
  say("goal", $("goal").value);
};
$("goal-drop").onclick = () => say("goal", null);
$("class-form").onsubmit = (event) => {
  event.preventDefault();
  edit("class", { class: $("class-name").value, is: $("class-is").value, forbidden: $("class-forbidden").checked, of_things: $("class-of-things").checked });
};
$("fact-form").onsubmit = (event) => {
  event.preventDefault();
  edit("fact", { fact: $("fact").value });
};
$("undo").onclick = () => edit("undo", { undo: true });
