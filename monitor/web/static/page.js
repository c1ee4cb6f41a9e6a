"use strict";
const state = document.getElementById("state");
const link = document.getElementById("link");

async function refresh() {
  try {
    const answer = await fetch("/state", { cache: "no-store" });
    if (!answer.ok) throw new Error(answer.status);
    state.innerHTML = await answer.text();  // rendered and escaped by the server
    link.textContent = "live, renewed " + new Date().toLocaleTimeString();
  } catch (error) {
    if (!link.textContent.startsWith("NO")) link.textContent = "NO CONNECTION since " + new Date().toLocaleTimeString();
  }
}

state.addEventListener("click", async (event) => {
  if (!event.target.matches("[data-acknowledge]")) return;
  event.target.disabled = true;
  const answer = await fetch("/acknowledge", { method: "POST", headers: { "X-Modalwatch": "page" } });
  event.target.textContent = answer.ok ? "Told the monitor" : "Refused: " + answer.status;
});

setInterval(refresh, 2000);
