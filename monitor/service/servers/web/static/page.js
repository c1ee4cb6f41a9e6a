"use strict";
const state = document.getElementById("state");
const link = document.getElementById("link");

const patience = 60000;  // ms in which a monitor that was told is not asked to be told again
let said = { text: "", done: false, until: 0 };  // what became of the last click, through what is put in the page anew

async function refresh() {
  try {
    const answer = await fetch("/state", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.status);
    state.innerHTML = await answer.text();  // rendered and escaped by the server
    sayAgain();
    link.textContent = "live, renewed " + new Date().toLocaleTimeString();
  } catch (error) {
    if (!link.textContent.startsWith("NO")) link.textContent = "NO CONNECTION since " + new Date().toLocaleTimeString();
  }
}

function sayAgain() {
  const button = state.querySelector("[data-acknowledge]");
  if (!button || performance.now() > said.until) return;
  button.disabled = said.done;
  button.textContent = said.text;
}

function say(text, done) {
  said = { text, done, until: performance.now() + patience };
  sayAgain();
}

state.addEventListener("click", async (event) => {
  const button = event.target;
  if (!button.matches("[data-acknowledge]")) return;
  button.disabled = true;
  try {
    const answer = await fetch("/acknowledge", { method: "POST", headers: { "X-Modalwatch": "page" } });
    if (answer.ok) say("The monitor is told", true);
    else say("Refused: " + (await answer.text()).trim(), false);
  } catch (error) {
    say("No connection: try again", false);
  }
});

setInterval(refresh, 2000);
