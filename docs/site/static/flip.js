// A free rigid body in closed form, without integration: freeBody(J, mu) is its motion, and every element of the class
// "flip" shows one, with sliders.  Source: Whittaker, Analytical Dynamics, 4th ed., sections 69-71; DLMF 22.20, 19.8.
"use strict";

// ------------------------------------------------------------------ the motion

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const scaled = (k, a) => a.map((x) => k * x);
const unit = (i, k = 1) => [0, 1, 2].map((j) => (j === i ? k : 0));
const applied = (m, a) => m.map((row) => dot(row, a));
const transposed = (m) => [0, 1, 2].map((i) => m.map((row) => row[i]));
const product = (m, n) => { const columns = transposed(n); return m.map((row) => columns.map((column) => dot(row, column))); };
const matrix = (image) => transposed([0, 1, 2].map((i) => image(unit(i))));

/** The rotation about the unit vector e by an angle. */
function rotation(e, angle) {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  return matrix((x) => x.map((_, i) => c * x[i] + s * cross(e, x)[i] + (1 - c) * dot(e, x) * e[i]));
}

/** The least rotation that takes the unit vector n to the unit vector e, which is not -n. */
function leastRotation(n, e) {
  const v = cross(n, e);
  return matrix((x) => x.map((_, i) => x[i] + cross(v, x)[i] + cross(v, cross(v, x))[i] / (1 + dot(n, e))));
}

/** The pairs (a, b) of the arithmetic-geometric mean of 1 and b; the mean is the last a. */
function means(b) {
  const pairs = [[1, b]];
  for (let a = 1; a - b > Number.EPSILON * a; pairs.push([a, b])) [a, b] = [(a + b) / 2, Math.sqrt(a * b)];
  return pairs;
}

/** Jacobi's functions of the complementary modulus k1: the quarter period K, am(u) and its inverse F(phi). */
function jacobi(k1) {
  const pairs = means(k1), last = 2 ** (pairs.length - 1) * pairs.at(-1)[0];
  return {
    K: Math.PI / 2 / pairs.at(-1)[0],
    am(u) {
      let phi = last * u;
      for (let n = pairs.length - 2; n >= 0; n--) phi = (phi + Math.asin((pairs[n][0] - pairs[n][1]) / (pairs[n][0] + pairs[n][1]) * Math.sin(phi))) / 2;
      return phi;
    },
    F(phi) {
      for (const [a, b] of pairs.slice(0, -1)) {
        const slope = Math.tan(phi);
        phi += Math.atan(b / a * slope) + (phi - Math.atan(slope)); // the second one is half turns
      }
      return phi / last;
    },
  };
}

/** The motion of a body with the principal moments J and the body momentum mu at t = 0: its period, `momentum` by the
 * amplitude, and `at`, which gives the momentum mu and the attitude g, the identity at t = 0, at any time.
 *
 * The momentum circles the axis c, and a, b are the others, b the middle one:
 *   mu_a = A cn u,   mu_b = A/sqrt(r) sn u,   mu_c = +-C dn u,   u = u0 + rate t.
 * With n = mu/|mu|, e = +-e_c and R(n) the least rotation that takes n to e, the attitude is
 *   g = R(n(0))^T Rot(e, psi) R(n),   psi' = (omega . n + omega . e)/(1 + n . e),
 * where psi' is an even function of u with the period 2 K: its Fourier series is integrated term by term.
 */
function freeBody(J, mu) {
  const [least, b, most] = [0, 1, 2].sort((i, k) => J[i] - J[k] || i - k), round = J[least] === J[most];
  const share = (a, c) => (J[a] * (J[b] - J[c])) / (J[b] * (J[a] - J[c]));
  let [a, c, r, q] = [least, most, round ? 1 : share(least, most), round ? 0 : share(most, least)];
  const beyond = r * mu[c] ** 2 - q * mu[a] ** 2; // the separatrix is 0
  if (beyond < 0 || (beyond === 0 && r < q)) [a, c, r, q] = [c, a, q, r];
  const C = Math.hypot(mu[c], Math.sqrt(q) * mu[b]), A = Math.hypot(mu[a], Math.sqrt(r) * mu[b]), sign = mu[c] < 0 ? -1 : 1;
  // on the separatrix itself k' is a rounding error
  const k1 = r * C ? Math.max(Math.sqrt(Math.abs(beyond) / r) / C, Number.EPSILON) : 1;
  const { K, am, F } = jacobi(k1);
  const rate = ((b - a + 3) % 3 === 1 ? sign : -sign) * (1 / J[a] - 1 / J[c]) * Math.sqrt(r) * C;
  const u0 = F(Math.atan2(Math.sqrt(r) * mu[b], mu[a])), L = Math.hypot(...mu);
  const dn = (phi) => Math.hypot(Math.cos(phi), k1 * Math.sin(phi));
  const momentum = (phi) => {
    const m = unit(a, A * Math.cos(phi));
    m[b] = A / Math.sqrt(r) * Math.sin(phi);
    m[c] = sign * C * dn(phi);
    return m;
  };

  const twice = dot(mu, mu.map((x, i) => x / J[i])); // of the energy
  const speed = (u) => { const m = C * dn(am(u)); return (twice / L + m / J[c]) / (1 + m / L); };
  const terms = Math.ceil((-Math.log(Number.EPSILON) * K) / (Math.PI * jacobi(Math.sqrt(Math.max(1 - k1 * k1, 0)) || Number.EPSILON).K)) + 4;
  const speeds = Array.from({ length: terms + 1 }, (_, j) => speed(K * j / terms) * (j % terms ? 2 : 1) / (2 * terms));
  const series = speeds.map((_, m) => (m % terms ? 2 : 1) * speeds.reduce((sum, f, j) => sum + f * Math.cos(Math.PI * m * j / terms), 0));
  const waves = (u) => series.reduce((sum, x, m) => (m ? sum + x * K / (Math.PI * m) * Math.sin(Math.PI * m * u / K) : sum), 0);

  const e = unit(c, sign), at0 = transposed(leastRotation(scaled(1 / L, mu), e));
  return {
    period: (4 * K) / Math.abs(rate),
    momentum,
    at(t) {
      const u = u0 + rate * t, now = momentum(am(u));
      const psi = series[0] * t + (rate ? (waves(u) - waves(u0)) / rate : 0);
      return { mu: now, g: product(at0, product(rotation(e, psi), leastRotation(scaled(1 / L, now), e))) };
    },
  };
}

// ------------------------------------------------------------------ the picture

const MOMENTUM = 4; // |mu| in kg m^2/s
const COLORS = ["#d55e00", "#009e73", "#b35c9e"]; // of the axes
const SLIDERS = [
  ["J1", "J<sub>1</sub>", 0.5, 3, 0.01, 1, "kg m²"],
  ["J2", "J<sub>2</sub>", 0.5, 3, 0.01, 2, "kg m²"],
  ["J3", "J<sub>3</sub>", 0.5, 3, 0.01, 2.6, "kg m²"],
  ["aim", "tilt", 0, 90, 0.1, 2, "°"],
  ["about", "direction", 0, 360, 1, 60, "°"],
];

/** The rows right, up and towards the eye of a view from a direction. */
function viewFrom(eye, up) {
  const towards = scaled(1 / Math.hypot(...eye), eye), right = cross(up, towards), across = scaled(1 / Math.hypot(...right), right);
  return [across, cross(towards, across), towards];
}

/** A square canvas in which the ball of radius 1 fills most of the width. */
class Stage {
  constructor(canvas, eye, up) {
    Object.assign(this, { canvas, view: viewFrom(eye, up), pen: canvas.getContext("2d") });
  }

  begin() {
    const { canvas, pen } = this, size = Math.round(canvas.clientWidth * devicePixelRatio);
    if (canvas.width !== size) canvas.width = canvas.height = size;
    Object.assign(this, { size, unit: 0.38 * size, line: size / 300, ink: getComputedStyle(canvas).color });
    pen.clearRect(0, 0, size, size);
    pen.lineJoin = pen.lineCap = "round";
  }

  depth(x) { return dot(this.view[2], x); }

  place(x) { return [this.size / 2 + this.unit * dot(this.view[0], x), this.size / 2 - this.unit * dot(this.view[1], x)]; }

  path(points, closed) {
    this.pen.beginPath();
    for (const x of points) this.pen.lineTo(...this.place(x));
    if (closed) this.pen.closePath();
  }

  curve(points, color, width, opacity = 1) { // what is behind the ball is pale
    const { pen } = this;
    Object.assign(pen, { strokeStyle: color, lineWidth: width * this.line });
    for (let k = 1; k < points.length; k++) {
      pen.globalAlpha = opacity * (this.depth(points[k]) < 0 ? 0.2 : 1);
      this.path(points.slice(k - 1, k + 1));
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  polygon(points, color, edge) {
    this.path(points, true);
    Object.assign(this.pen, { fillStyle: color, strokeStyle: edge, lineWidth: this.line });
    this.pen.fill();
    this.pen.stroke();
  }

  arrow(from, to, color, width) {
    const [a, b] = [this.place(from), this.place(to)], angle = Math.atan2(b[1] - a[1], b[0] - a[0]), head = 5 * width * this.line, { pen } = this;
    Object.assign(pen, { strokeStyle: color, fillStyle: color, lineWidth: width * this.line });
    pen.beginPath();
    pen.moveTo(...a);
    pen.lineTo(b[0] - head * Math.cos(angle) * 0.8, b[1] - head * Math.sin(angle) * 0.8);
    pen.stroke();
    pen.beginPath();
    for (const turn of [0, 2.7, -2.7]) pen.lineTo(b[0] + (turn ? head * Math.cos(angle + turn) : 0), b[1] + (turn ? head * Math.sin(angle + turn) : 0));
    pen.fill();
  }

  text(word, x, color) {
    Object.assign(this.pen, { fillStyle: color, font: `${15 * this.line}px system-ui, sans-serif`, textAlign: "center", textBaseline: "middle" });
    this.pen.fillText(word, ...this.place(x));
  }
}

/** The sides of the box whose principal moments are in the ratio of J, in a ball of radius 0.85; 0 where there is none. */
function boxSides(J) {
  const squares = J.map((x) => Math.max(J[0] + J[1] + J[2] - 2 * x, 0)), most = Math.hypot(...squares.map(Math.sqrt));
  return squares.map((x) => 0.85 * Math.sqrt(x) / most);
}

/** The box at the attitude g, its axes, and its momentum, which stands still. */
function drawBody(stage, J, g, direction) {
  const half = boxSides(J), axes = transposed(g), lamp = viewFrom([1, 1.5, 2], unit(1))[2];
  const sum = (...parts) => [0, 1, 2].map((j) => parts.reduce((total, [k, x]) => total + k * x[j], 0));
  const axis = (i, front) => {
    if (stage.depth(axes[i]) > 0 === front) {
      stage.arrow(scaled(front ? half[i] : 0, axes[i]), scaled(1.08, axes[i]), COLORS[i], 1.6);
      stage.text(i + 1, scaled(1.2, axes[i]), COLORS[i]);
    }
  };
  stage.begin();
  for (const i of [0, 1, 2]) axis(i, false);
  for (const i of [0, 1, 2]) {
    const [j, k] = [(i + 1) % 3, (i + 2) % 3], sign = stage.depth(axes[i]) > 0 ? 1 : -1, at = (x, y) => sum([sign * half[i], axes[i]], [x * half[j], axes[j]], [y * half[k], axes[k]]);
    const light = 58 + 34 * Math.max(sign * dot(axes[i], lamp), 0), tone = i < 2 ? [215, 12] : sign > 0 ? [28, 85] : [205, 75];
    stage.polygon([at(-1, -1), at(1, -1), at(1, 1), at(-1, 1)], `hsl(${tone[0]} ${tone[1]}% ${light * (i < 2 ? 0.95 : 0.7)}%)`, "#33404f");
    if (i === 2) stage.polygon([at(-0.12, -0.6), at(0.12, -0.6), at(0.12, 0.1), at(0.4, 0.1), at(0, 0.65), at(-0.4, 0.1), at(-0.12, 0.1)], "#ffffffd0", "#33404f80");
  }
  for (const i of [0, 1, 2]) axis(i, true);
  stage.arrow(scaled(0.95, direction), scaled(1.25, direction), stage.ink, 2.2);
  stage.text("μ", scaled(1.15, direction).map((x, i) => x + 0.1 * stage.view[0][i]), stage.ink);
}

/** The sphere |mu| = const with curves of constant energy, the separatrix, the curve of this motion, and its momentum. */
function drawSphere(stage, curves, polhode, n) {
  stage.begin();
  const { pen, size } = stage, shade = pen.createRadialGradient(0.4 * size, 0.35 * size, 0, size / 2, size / 2, stage.unit);
  shade.addColorStop(0, "#8fb4d81a");
  shade.addColorStop(1, "#5f8fbf55");
  pen.beginPath();
  pen.arc(size / 2, size / 2, stage.unit, 0, 2 * Math.PI);
  pen.fillStyle = shade;
  pen.fill();
  for (const points of curves.levels) stage.curve(points, stage.ink, 0.7, 0.35);
  for (const points of curves.separatrix) stage.curve(points, stage.ink, 1.3, 0.8);
  for (const i of [0, 1, 2]) {
    if (stage.depth(unit(i)) > 0) stage.arrow(unit(i), unit(i, 1.1), COLORS[i], 1.6);
    stage.text(i + 1, unit(i, 1.2), COLORS[i]);
  }
  stage.curve(polhode, "#0072b2", 2.6);
  stage.arrow([0, 0, 0], n, "#0072b2", 2);
  stage.text("μ", scaled(0.5, n).map((x, i) => x + 0.08 * stage.view[1][i]), "#0072b2");
}

/** The closed curve of the direction n. */
function orbit(J, n) {
  const motion = freeBody(J, n), steps = 180;
  return Number.isFinite(motion.period) ? Array.from({ length: steps + 1 }, (_, k) => motion.momentum(2 * Math.PI * k / steps)) : [n, n];
}

/** Curves of constant energy on the sphere, and the two circles of the separatrix. */
function energyCurves(J) {
  const [a, b, c] = [0, 1, 2].sort((i, k) => J[i] - J[k]), between = (angle, i, k) => [0, 1, 2].map((j) => unit(i, Math.cos(angle))[j] + unit(k, Math.sin(angle))[j]);
  const starts = [a, c].flatMap((pole) => [0.3, 0.65, 1, 1.3].flatMap((angle) => [between(angle, pole, b), between(Math.PI - angle, pole, b)]));
  const [p, q] = [Math.sqrt(1 / J[b] - 1 / J[c]), Math.sqrt(1 / J[a] - 1 / J[b])].map((x, _, both) => x / Math.hypot(...both));
  const circle = (sign) => Array.from({ length: 181 }, (_, k) => {
    const [x, y] = [Math.cos(k * Math.PI / 90), Math.sin(k * Math.PI / 90)];
    return [0, 1, 2].map((j) => unit(a, p * x)[j] + unit(c, sign * q * x)[j] + unit(b, y)[j]);
  });
  return { levels: J[a] < J[c] ? starts.map((n) => orbit(J, n)) : [], separatrix: J[a] < J[b] && J[b] < J[c] ? [circle(1), circle(-1)] : [] };
}

/** A moving body with its sliders in an element of the page. */
function showFlip(home) {
  const rows = SLIDERS.map(([name, label, ...rest]) => `<label for="flip-${name}">${label}</label><input type="range" id="flip-${name}" min="${rest[0]}" max="${rest[1]}" step="${rest[2]}" value="${rest[3]}"><output for="flip-${name}"></output>`);
  home.innerHTML = `<canvas role="img" aria-label="the body in space, its momentum upright"></canvas><canvas role="img" aria-label="its momentum, seen from the body, on a sphere with curves of constant energy"></canvas>
<div class="flip-controls">${rows.map((row) => `<span>${row}</span>`).join("")}</div><p><button type="button">pause</button> <span></span></p>`;
  const [left, right] = home.querySelectorAll("canvas"), [button, words] = [home.querySelector("button"), home.querySelector("p span")];
  const inputs = SLIDERS.map(([name]) => home.querySelector(`#flip-${name}`));
  const body = new Stage(left, [0.75, 0.3, 1], unit(1)), sphere = new Stage(right, [0.5, 1, 0.4], unit(2));
  let J, motion, curves, polhode, upright, start, request, time = 0, last = null, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;

  function changed(event) {
    const values = inputs.map((input) => Number(input.value)), [aim, about] = values.slice(3).map((x) => x * Math.PI / 180);
    inputs.forEach((input, k) => {
      const shown = `${values[k].toFixed(k < 3 ? 2 : k === 3 ? 1 : 0)} ${SLIDERS[k][6]}`.replace(" °", "°");
      input.setAttribute("aria-valuetext", shown);
      input.nextElementSibling.value = shown;
    });
    if (!J || !event || values.slice(0, 3).some((x, k) => x !== J[k])) curves = energyCurves(J = values.slice(0, 3));
    start = [Math.sin(aim) * Math.cos(about), Math.cos(aim), Math.sin(aim) * Math.sin(about)];
    motion = freeBody(J, scaled(MOMENTUM, start));
    [polhode, upright, time] = [orbit(J, start), leastRotation(start, unit(1)), 0];
    draw();
  }

  function draw() {
    const { mu, g } = motion.at(time), most = Math.max(...J), period = motion.period;
    drawBody(body, J, product(upright, g), unit(1));
    drawSphere(sphere, curves, polhode, scaled(1 / MOMENTUM, mu));
    words.textContent = `t = ${time.toFixed(1)} s; ` + (Number.isFinite(period) ? `μ returns after ${period.toPrecision(3)} s` : "μ stands still") +
      (2 * most > J[0] + J[1] + J[2] ? "; no solid body has these moments: one is more than the sum of the others" : "");
  }

  function frame(now) {
    time += last === null ? 0 : Math.min(now - last, 100) / 1000;
    [last, request] = [now, requestAnimationFrame(frame)];
    draw();
  }

  function play(on, seen = true) {
    cancelAnimationFrame(request);
    [playing, last] = [on, null];
    button.textContent = on ? "pause" : "play";
    if (on && seen) request = requestAnimationFrame(frame);
  }

  function aimAt(event) { // the start is where the sphere is clicked
    const box = right.getBoundingClientRect(), [x, y] = [(event.clientX - box.x) / box.width - 0.5, 0.5 - (event.clientY - box.y) / box.height].map((z) => z / 0.38);
    if (x * x + y * y > 1) return;
    const n = applied(transposed(sphere.view), [x, y, Math.sqrt(1 - x * x - y * y)]);
    inputs[3].value = Math.acos(Math.min(n[1], 1)) * 180 / Math.PI;
    inputs[4].value = (Math.atan2(n[2], n[0]) * 180 / Math.PI + 360) % 360;
    changed(event);
  }

  inputs.forEach((input) => input.addEventListener("input", changed));
  right.addEventListener("click", aimAt);
  right.addEventListener("pointermove", (event) => { if (event.pointerType === "mouse" && event.buttons === 1) aimAt(event); });
  button.addEventListener("click", () => play(!playing));
  new ResizeObserver(draw).observe(left);
  new IntersectionObserver(([{ isIntersecting }]) => play(playing, isIntersecting)).observe(left);
  changed();
  home.seek = (t) => { play(false); time = t; draw(); };
}

if (typeof document !== "undefined") document.querySelectorAll(".flip").forEach(showFlip);
