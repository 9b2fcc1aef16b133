"use strict";
// The two pictures of a machine: where it is on its plan, and what it sees, from above.

const BODY_M = [[1.6, 1.3], [1.6, -1.3], [-6, -1.2], [-6, 1.2]]; // about a loader of 11 t: a mark, not a measure

function fitted(canvas, points, margin = 18) {
  // Returns a function from metres to pixels, x to the right and y up, the same scale for both.
  const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
  const low = [Math.min(...xs), Math.min(...ys)], high = [Math.max(...xs), Math.max(...ys)];
  const wide = Math.max(high[0] - low[0], 10), tall = Math.max(high[1] - low[1], 10);
  const scale = Math.min((canvas.width - 2 * margin) / wide, (canvas.height - 2 * margin) / tall);
  const middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  return ([x, y]) => [canvas.width / 2 + (x - middle[0]) * scale, canvas.height / 2 - (y - middle[1]) * scale];
}

function stroke(pen, points, colour, width = 1.5, closed = false) {
  pen.beginPath();
  points.forEach((p, k) => (k ? pen.lineTo(...p) : pen.moveTo(...p)));
  if (closed) pen.closePath();
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.stroke();
}

function placed([x, y, heading], points) {
  const c = Math.cos(heading), s = Math.sin(heading);
  return points.map(([a, b]) => [x + c * a - s * b, y + s * a + c * b]);
}

function body(pen, toPixel, pose, colour) {
  const corners = placed(pose, BODY_M).map(toPixel);
  stroke(pen, corners, colour, 2, true);
  stroke(pen, placed(pose, [[-2, 0], [4, 0]]).map(toPixel), colour, 2);
}

function drawPlan(canvas, plan, status, trail) {
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const pose = status && status.pose, lines = plan ? plan.lines_m : [];
  const all = lines.flat().concat(trail, pose ? [[pose[0] - 8, pose[1] - 8], [pose[0] + 8, pose[1] + 8]] : []);
  if (!all.length) return;
  const toPixel = fitted(canvas, all);
  lines.forEach((line) => stroke(pen, line.map(toPixel), "#9aa5b1"));
  pen.fillStyle = "#46525e";
  pen.font = "11px sans-serif";
  (plan ? plan.places : []).forEach(([name, x, y]) => {
    const [px, py] = toPixel([x, y]);
    pen.fillRect(px - 2, py - 2, 4, 4);
    pen.fillText(name, Math.min(px + 5, canvas.width - pen.measureText(name).width - 2), py - 4);
  });
  if (trail.length > 1) stroke(pen, trail.map(toPixel), "#64b5f6", 2);
  if (pose) body(pen, toPixel, pose, status.armed ? "#2e7d32" : "#c62828");
  else pen.fillText("place not known", 10, 16);
}

function drawCloud(canvas, request) {
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, canvas.width, canvas.height);
  const turned = (points) => points.map(([x, y]) => [-y, x]); // ahead is up
  const near = turned(request.cloud_m).filter(([x, y]) => Math.hypot(x, y) < 30);
  const toPixel = fitted(canvas, near.concat([[-5, -8], [5, 8]]));
  pen.fillStyle = "#37474f";
  near.map(toPixel).forEach(([x, y]) => pen.fillRect(x - 1, y - 1, 2, 2));
  body(pen, toPixel, [0, 0, Math.PI / 2], "#2e7d32");
  if (request.pile_m.length) stroke(pen, turned(request.pile_m).map(toPixel), "#e67e00", 3);
  pen.fillStyle = "#46525e";
  pen.font = "11px sans-serif";
  pen.fillText(request.pile_m.length ? "hits from above; toe of the pile" : "hits from above; no pile", 8, 14);
}
