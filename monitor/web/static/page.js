"use strict";
const state = document.getElementById("state");
const link = document.getElementById("link");

const patience = 60000;  // ms in which a monitor that was told is not asked to be told again
let told = -patience;

async function refresh() {
  try {
    const answer = await fetch("/state", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.status);
    state.innerHTML = await answer.text();  // rendered and escaped by the server
    if (performance.now() - told < patience) sayTold();
    link.textContent = "live, renewed " + new Date().toLocaleTimeString();
  } catch (error) {
    if (!link.textContent.startsWith("NO")) link.textContent = "NO CONNECTION since " + new Date().toLocaleTimeString();
  }
}

function sayTold() {
  const button = state.querySelector("[data-acknowledge]");
  if (!button) return;
  button.disabled = true;
  button.textContent = "The monitor is told";
}

state.addEventListener("click", async (event) => {
  const button = event.target;
  if (!button.matches("[data-acknowledge]")) return;
  button.disabled = true;
  try {
    const answer = await fetch("/acknowledge", { method: "POST", headers: { "X-Modalwatch": "page" } });
    if (!answer.ok) throw new Error("Refused: " + answer.status);
    told = performance.now();
    sayTold();
  } catch (error) {
    button.disabled = false;
    button.textContent = error.message.startsWith("Refused") ? error.message : "No connection: try again";
  }
});

setInterval(refresh, 2000);
