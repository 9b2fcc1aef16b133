"use strict";
// The operator's page. Its main thread answers each tick of a machine: a page that hangs, or that nobody sees, is silent, and the
// machine stops by itself. Nothing from outside is ever put in as HTML.

const find = (selector, root = document) => root.querySelector(selector);
const machines = new Map(); // name: {card, plan, status, trail, request, connected}
const ANSWERS = { go_on: "Go on", loaded: "Loaded by hand", abort: "Abort" };
const EVENTS_MOST = 200, TRAIL_MOST = 400;
let viewer = "", socket = null, page = "", seat = { by: "", page: "" };

async function post(path, body) {
  const response = await fetch(path, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
  let why = "";
  if (!response.ok) why = ((await response.json().catch(() => null)) || {}).why || `refused (${response.status})`;
  if (response.status === 401) begin();
  return why;
}

async function asks(path, body) {
  find("#why").textContent = await post(path, body);
}

async function begin() {
  const response = await fetch("/me");
  find("#login").hidden = response.ok;
  find("#console").hidden = !response.ok;
  if (!response.ok) return;
  const me = await response.json();
  find("#me").textContent = me.name;
  viewer = me.viewer;
  find("#picture").hidden = !viewer;
  find("#columns").classList.toggle("viewed", Boolean(viewer));
  connect();
}

function connect() {
  if (socket && socket.readyState < 2) return;
  socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/page`);
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    (TAKES[message.type] || (() => {}))(message);
  };
  socket.onclose = () => {
    page = "";
    seat = { by: "", page: "" };
    showSeat();
    find("#link").textContent = "not connected to the console";
    setTimeout(begin, 1000);
  };
}

const TAKES = {
  you: (m) => { page = m.page; find("#events").replaceChildren(); },
  seat: (m) => { seat = m; showSeat(); },
  machine: (m) => { machineOf(m.name).connected = m.connected; show(m.name); },
  plan: (m) => { machineOf(m.machine).plan = m; show(m.machine); look(); }, // a machine that begins has its data ready
  status: (m) => {
    const machine = machineOf(m.machine), last = machine.trail[machine.trail.length - 1];
    machine.status = m;
    if (m.pose && (!last || Math.hypot(m.pose[0] - last[0], m.pose[1] - last[1]) > 0.3)) machine.trail.push(m.pose.slice(0, 2));
    if (machine.trail.length > TRAIL_MOST) machine.trail.shift();
    show(m.machine);
  },
  asked: (m) => { machineOf(m.machine).request = m.request; showRequest(m.machine); },
  tick: (m) => {
    if (!document.hidden) socket.send(JSON.stringify({ machine: m.machine, number: m.number })); // from this thread, at once
    const ms = Math.round(1000 * m.round_trip_s), most = Math.round(1000 * m.limit_s);
    find("#link").textContent = mine() ? `round trip ${ms} ms (at most ${most} ms)` : "";
  },
  outcome: (m) => {
    if (!m.taken) find("#why").textContent = `${m.machine}: ${m.why}`;
    addEvent({ ...m, time_s: null, process: "command", text: m.taken ? "taken" : `refused: ${m.why}`, grave: !m.taken });
  },
  event: (m) => addEvent(m),
  alarms: (m) => showAlarms(m),
};

function look() {
  if (viewer) find("#viewer").src = viewer;
}

const mine = () => page !== "" && seat.page === page;

function machineOf(name) {
  if (!machines.has(name)) {
    const card = find("#machine").content.cloneNode(true).firstElementChild;
    card.dataset.machine = name;
    find(".name", card).textContent = name;
    find(".rearm", card).onclick = () => command(name, "rearm");
    find(".stop", card).onclick = () => command(name, "stop");
    find("#machines").append(card);
    machines.set(name, { card, plan: null, status: null, trail: [], request: null, connected: false });
  }
  return machines.get(name);
}

function command(machine, kind, number = 0, answer = "") {
  return asks("/command", { page, machine, kind, number, answer });
}

function show(name) {
  const { card, plan, status, trail, connected } = machineOf(name), state = find(".state", card);
  const armed = Boolean(connected && status && status.armed);
  state.textContent = !connected ? "not connected" : armed ? "armed" : "not armed";
  state.className = `state ${armed ? "armed" : "stopped"}`;
  const facts = status ? [`${status.time_s.toFixed(1)} s`, status.mode, status.doing, status.mission, status.standing ? "stands" : "moves",
    ...(armed ? [] : status.causes)] : ["starting"];
  find(".facts", card).textContent = facts.filter(Boolean).join(" · ");
  find(".rearm", card).disabled = !mine() || armed || !connected || !status;
  find(".stop", card).disabled = !mine() || !connected;
  drawPlan(find(".plan", card), plan, status, trail);
}

function showRequest(name) {
  const { card, request } = machineOf(name), box = find(".request", card);
  box.hidden = !request;
  if (!request) return;
  find("h3", box).textContent = `Request ${request.number}: ${request.kind}, during ${request.during}`;
  find(".why", box).textContent = request.why;
  find(".asks", box).textContent = request.asks;
  find(".tried", box).replaceChildren(...request.tried.map((text) => element("li", `tried: ${text}`)));
  const offered = Object.entries(ANSWERS).filter(([answer]) => answer !== "loaded" || request.kind !== "navigation");
  find(".answers", box).replaceChildren(...offered.map(([answer, text]) => {
    const button = element("button", text);
    button.type = "button";
    button.dataset.answer = answer;
    button.disabled = !mine();
    button.onclick = () => command(name, "answer", request.number, answer);
    return button;
  }));
  find("table", box).replaceChildren(...request.evidence.map(([key, value]) => {
    const row = element("tr", "");
    row.append(element("td", key), element("td", value));
    return row;
  }));
  drawCloud(find(".cloud", box), request);
}

function showSeat() {
  find("#seat-by").textContent = seat.by ? `${seat.by} operates${mine() ? " (you, on this page)" : ""}` : "nobody operates";
  find("#seat").textContent = mine() ? "Leave the seat" : "Take the seat";
  find("#seat").disabled = page === "";
  for (const name of machines.keys()) { show(name); showRequest(name); }
}

function showAlarms({ alarms, held_back: heldBack }) {
  const shown = alarms.map((a) => {
    const line = element("p", `${a.machine}: ${a.text}${a.times > 1 ? ` (${a.times} times)` : ""}`);
    line.className = `rank${a.rank}`;
    return line;
  });
  if (heldBack) shown.push(element("p", `${heldBack} more are in the events alone`));
  find("#alarms").replaceChildren(...shown);
}

function addEvent(m) {
  const line = element("li", `${m.time_s === null ? "" : `${m.time_s.toFixed(1)} s `}${m.machine} ${m.process}: ${m.text}`);
  if (m.grave) line.className = "grave";
  find("#events").prepend(line);
  while (find("#events").children.length > EVENTS_MOST) find("#events").lastChild.remove();
}

function element(tag, text) {
  const made = document.createElement(tag);
  made.textContent = text;
  return made;
}

find("#login").onsubmit = async (event) => {
  event.preventDefault();
  find("#login-why").textContent = await post("/login", { name: find("#name").value, code: find("#code").value });
  find("#code").value = "";
  if (!find("#login-why").textContent) begin();
};
find("#logout").onclick = async () => { await post("/logout", {}); socket.close(); };
find("#look").onclick = look;
find("#seat").onclick = () => asks("/seat", { page, take: !mine() });
begin();
