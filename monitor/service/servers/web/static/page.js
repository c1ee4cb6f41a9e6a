"use strict";
const state = document.getElementById("state");
const link = document.getElementById("link");

const patience = 60000;  // ms in which an acknowledgement is not sent again
const clock = () => new Date().toISOString().slice(11, 19) + " UTC";  // as all times of the page
let outcome = { text: "", done: false, until: 0 };  // of the last click, kept while the page is renewed

async function refresh() {
  try {
    const answer = await fetch("/state", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.status);
    state.innerHTML = await answer.text();  // rendered and escaped by the server
    showOutcome();
    link.textContent = "live, renewed " + clock();
  } catch (error) {
    if (!link.textContent.startsWith("NO")) link.textContent = "NO CONNECTION since " + clock();
  }
}

function showOutcome() {
  const button = state.querySelector("[data-acknowledge]");
  if (!button || performance.now() > outcome.until) return;
  button.disabled = outcome.done;
  button.textContent = outcome.text;
}

function setOutcome(text, done) {
  outcome = { text, done, until: performance.now() + patience };
  showOutcome();
}

state.addEventListener("click", async (event) => {
  const button = event.target;
  if (!button.matches("[data-acknowledge]")) return;
  button.disabled = true;
  try {
    const answer = await fetch("/acknowledge", { method: "POST", headers: { "X-Modalwatch": "page" } });
    if (answer.ok) setOutcome("Acknowledgement sent", true);
    else setOutcome("Refused: " + (await answer.text()).trim(), false);
  } catch (error) {
    setOutcome("No connection: try again", false);
  }
});

setInterval(refresh, 2000);
