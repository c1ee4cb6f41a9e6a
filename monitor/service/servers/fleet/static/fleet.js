"use strict";
const sites = document.getElementById("sites");
const link = document.getElementById("link");

async function refresh() {
  if (document.hidden) return;
  try {
    const answer = await fetch("/sites" + location.search, { cache: "no-store" });
    sites.innerHTML = await answer.text();  // rendered and escaped by the server
    link.textContent = "live, renewed " + new Date().toISOString().slice(11, 19) + " UTC";
  } catch (error) {
    if (!link.textContent.startsWith("NO")) link.textContent = "NO CONNECTION since " + new Date().toISOString().slice(11, 19) + " UTC";
  }
}

link.textContent = "live";
setInterval(refresh, 10000);
