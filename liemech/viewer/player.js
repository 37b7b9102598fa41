// The player of a scene: builds it with meshcat, draws its panels side by side, moves them by their tracks, and answers
// the bar, the keys and the mouse.  `window.player` is its face for programs, `window.ready` says that it stands.
"use strict";

function startPlayer() {
  const $ = (id) => document.getElementById(id);
  const typedArray = (v) => new globalThis[v.$](Uint8Array.from(atob(v.b), (c) => c.charCodeAt(0)).buffer);
  const scene = JSON.parse($("scene").textContent, (_, v) => (v && v.$ ? typedArray(v) : v));
  const say = (text) => { $("message").textContent = text; $("message").style.display = "block"; };

  // ---------------------------------------------------------------- the stage

  const THREE = MeshCat.THREE, pane = $("pane");
  let viewer;
  try {
    viewer = new MeshCat.Viewer(pane, false);
  } catch (error) {
    say("This page draws with WebGL, which this browser does not offer here. Switch hardware acceleration or WebGL on in its settings, or open the page in another browser.");
    $("bar").style.display = "none";
    window.failed = String(error);
    return;
  }
  const { camera, controls, renderer } = viewer;
  const node = (path) => viewer.scene_tree.find(path.split("/")), inside = (path) => node(path).children["<object>"].object;

  viewer.gui.domElement.remove(); // with all its inputs
  viewer.scene.background = null;
  const tone = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const dark = matchMedia("(prefers-color-scheme: dark)").matches, paper = new THREE.Color(tone("--paper"));
  renderer.setClearColor(paper, 1);
  renderer.autoClear = false;
  if (scene.socket) scene.panels.forEach((panel) => { panel.floor = false; }); // nobody knows how deep it will go
  Object.assign(renderer.shadowMap, { enabled: scene.panels.some(({ floor }) => floor !== false), autoUpdate: false, type: THREE.PCFShadowMap });
  for (const name of ["Lights", "Grid", "Axes"]) node(name).object.visible = false;
  const [lamp, rim, sun] = [0.48, 0.25, 0.1].map((strength) => new THREE.DirectionalLight(0xffffff, strength));
  viewer.scene.add(new THREE.HemisphereLight(0xffffff, 0xd6cec2, 0.73), lamp, lamp.target, rim, sun);
  sun.castShadow = true; // on floors
  sun.position.set(0.3, -0.4, 3);
  Object.assign(sun.shadow, { radius: 4, mapSize: new THREE.Vector2(512, 512) });
  Object.assign(sun.shadow.camera, { left: -1.6, right: 1.6, top: 1.6, bottom: -1.6, near: 0.5, far: 6 });

  for (const command of scene.commands) viewer.handle_command(command);
  const panels = scene.panels.map((panel) => ({ ...panel, object: node(panel.path).object, rect: [0, 0, 1, 1] }));
  const trails = new Set(scene.tracks.filter(({ channel }) => channel === "reveal").map(({ path }) => inside(path)));
  viewer.scene.traverse((object) => {
    const { type, attributes = {} } = object.geometry || {}, { colors, tints, sides } = object.userData;
    // many programs write STL files with normals of zero, which would be black
    const black = attributes.normal?.array.some((_, k, n) => k % 3 === 0 && !n[k] && !n[k + 1] && !n[k + 2]);
    if (black) object.geometry.computeVertexNormals();
    if (object.isMesh) object.castShadow = !trails.has(object);
    if (colors) object.userData.colors = colors.map(night);
    else if (tints) for (let k = 0; k < tints.length; k += 3) tints.set(night([...tints.subarray(k, k + 3)]), k);
    else if (object.material?.color && !sides) object.material.color.fromArray(night(object.material.color.toArray()));
    if (type === "LatheGeometry") object.geometry.rotateX(Math.PI / 2); // about the third axis
    if (type === "BoxGeometry" && !object.isInstancedMesh) { // with its edges
      const color = object.material.color.clone().lerp(new THREE.Color(dark ? 0xffffff : 0), 0.45);
      object.add(new THREE.LineSegments(new THREE.EdgesGeometry(object.geometry), new THREE.LineBasicMaterial({ color })));
      object.children[0].scale.setScalar(1.002);
    }
    if (object.isInstancedMesh) {
      object.frustumCulled = false;
      if (sides) paintSides(object, sides);
      object.instanceMatrix = new THREE.InstancedBufferAttribute(new Float32Array(16 * object.count), 16);
    }
  });

  function night(rgb) { // on a dark page a grey is as light as it was dark, and a dark colour paler
    const most = Math.max(...rgb), least = Math.min(...rgb), grey = most - least < 0.16;
    return rgb.map((c) => (!dark ? c : grey ? Math.min(1, c + 1.05 - most - least) : most + least < 0.72 ? 0.7 * c + 0.3 : c));
  }

  function paintSides(object, sides) { // two colours in turn on the eight octants, or one for each of three sides and a fourth
    const geometry = object.geometry = object.geometry.toNonIndexed(), p = geometry.attributes.position.array;
    for (let k = 0, colors = []; k < p.length; k += 9) {
      const middle = [0, 1, 2].map((i) => p[k + i] + p[k + 3 + i] + p[k + 6 + i]);
      const side = sides.length === 2 ? middle.filter((x) => x > 0).length % 2 : middle.findIndex((x) => x > 1.49);
      colors.push(...[0, 1, 2].flatMap(() => sides.at(side)));
      if (k + 9 >= p.length) geometry.setAttribute("color", new THREE.Float32BufferAttribute(colors, 3));
    }
    object.material.vertexColors = true;
  }

  // ---------------------------------------------------------------- panels and camera

  const MARGIN = 1.32; // radius of the ball that is seen of a panel of a live scene, whose content reaches to 1.25
  const FIELD = 26 * Math.PI / 180; // of view, in the narrower direction
  const distance = MARGIN / Math.sin(FIELD / 2), DEGREE = Math.PI / 180;
  function look(azimuth, elevation, away = 1) { // the third axis of the scene is up, which is the second of three.js
    controls.target.set(0, 0, 0);
    camera.position.setFromSphericalCoords(away * distance, (90 - elevation) * DEGREE, (90 + azimuth) * DEGREE);
    controls.update();
  }
  Object.assign(camera, { near: 0.05 * distance, far: 20 * distance });
  Object.assign(controls, { minDistance: 0.2 * distance, maxDistance: 8 * distance });
  look(...scene.view);
  camera.updateMatrixWorld();
  const home = camera.clone();

  for (const panel of panels) {
    panel.caption = document.body.appendChild(document.createElement("div"));
    Object.assign(panel.caption, { className: "caption", title: panel.title });
    panel.caption.append(panel.title, ...(panel.ruler ? [document.createElement("i"), ""] : []));
  }

  const letters = scene.labels.map(({ path, text }) => { // names at the ends of axes, which bodies hide
    const sheet = document.createElement("canvas"), pen = sheet.getContext("2d");
    sheet.width = sheet.height = 128;
    Object.assign(pen, { font: "62px system-ui, sans-serif", textAlign: "center", textBaseline: "middle", fillStyle: tone("--ink") });
    pen.fillText(text, 64, 64);
    const map = new THREE.CanvasTexture(sheet), sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map, sizeAttenuation: false, depthWrite: false }));
    sprite.position.z = 1.09;
    node(path).object.add(sprite);
    return sprite;
  });

  function resize(letter, height) { // to 28 pixels, whatever the distance
    const size = 28 / height * 2 / camera.projectionMatrix.elements[5];
    letter.scale.setScalar(1);
    letter.updateWorldMatrix(true, false);
    letter.scale.setScalar(size / letter.getWorldScale(new THREE.Vector3()).x);
  }

  const MAIN = 0.6; // the share of the stage that orbits have beside bodies
  const hidden = new Set(); // numbers of runs
  let shown = panels;
  function layout() { // orbits have most of the stage, bodies the rest
    shown = panels.filter(({ runs }) => runs.some((run) => !hidden.has(run)));
    for (const panel of panels) panel.caption.hidden = !shown.includes(panel);
    const bare = document.body.classList.contains("bare");
    const width = pane.clientWidth, height = pane.clientHeight;
    const head = Math.min($("head").offsetHeight + ($("head").textContent.trim() ? 8 : 0), height / 3), foot = bare ? 4 : $("foot").offsetHeight + 4;
    const free = Math.max(1, height - head - foot), bodies = shown.filter(({ main }) => !main), orbits = shown.filter(({ main }) => main);
    const share = !orbits.length ? 1 : !bodies.length ? 0 : 1 - MAIN;
    const [w, h] = width > free ? [share * width, free] : [width, share * free];
    arrange(bodies, 0, head, w, h);
    if (width > free) arrange(orbits, w, head, width - w, free); else arrange(orbits, 0, head + h, width, free - h);
    renderer.setPixelRatio(window.devicePixelRatio);
    renderer.setSize(width, height);
    shown.filter((panel) => panel.extent).forEach(fit);
    viewer.needs_render = true;
  }

  function arrange(some, left, top, width, height) { // rows and columns that make these panels largest
    const line = 20, size = (columns) => Math.min(width / columns, height / Math.ceil(some.length / columns) - line);
    const columns = some.map((_, k) => k + 1).reduce((a, b) => (size(b) > size(a) ? b : a), 1);
    const w = width / columns, h = height / Math.ceil(some.length / columns);
    some.forEach((panel, k) => {
      const row = Math.floor(k / columns), inRow = Math.min(columns, some.length - row * columns);
      const x = left + (k % columns) * w + (columns - inRow) * w / 2, y = top + row * h;
      panel.rect = [x, y, w, Math.max(1, h - line)];
      const below = y + (h - line) / 2 + Math.min(w, h - line) / 2; // close to the picture
      Object.assign(panel.caption.style, { left: x + "px", width: w + "px", top: below + "px" });
    });
  }

  function hide(run) { // a run from all panels, or show it again
    if (!hidden.delete(run)) hidden.add(run);
    for (const { path, runs } of panels) if (runs.includes(run)) node(`${path}/run ${run + 1}`).object.visible = !hidden.has(run);
    document.querySelectorAll(".run" + run).forEach((curve) => curve.classList.toggle("hidden", hidden.has(run)));
    layout();
  }

  function measure() { // the points of every panel to which its content comes, at some times
    const TIMES = 24, MOST = 200;
    for (const panel of panels) panel.extent = [];
    for (let n = 0; n <= TIMES; n++) {
      for (const track of moving) move(track, scene.duration * n / TIMES);
      viewer.scene.updateMatrixWorld();
      for (const { object: root, extent } of panels) root.traverse((object) => {
        if (object.isSprite) return void extent.push(new THREE.Vector3(0, 0, 1.1).applyMatrix4(object.parent.matrixWorld));
        if (!object.geometry || !object.geometry.attributes.position) return;
        const { cloud, room = [0] } = object.userData, p = cloud || object.geometry.attributes.position.array;
        const every = 3 * Math.ceil(p.length / 3 / MOST);
        for (let k = 0; k < p.length; k += every) for (const side of room[0] ? [-1, 1] : [0]) for (let i = 0; i < (side ? 3 : 1); i++) {
          const point = new THREE.Vector3().fromArray(p, k);
          point.setComponent(i, point.getComponent(i) + side * room[i % room.length]);
          extent.push(point.applyMatrix4(object.matrixWorld));
        }
      });
    }
    moved.clear();
  }

  function fit(panel) { // the part of the film that holds the panel's content at the first view
    panel.part = null;
    aim(panel, home);
    const low = [1e9, 1e9], high = [-1e9, -1e9], v = new THREE.Vector3();
    for (const point of panel.extent) {
      v.copy(point).project(home);
      [v.x, -v.y].forEach((x, k) => { low[k] = Math.min(low[k], x); high[k] = Math.max(high[k], x); });
    }
    const size = Math.max(0.01, ...low.map((x, k) => high[k] - x)) / 2 / 0.88;
    panel.part = [...low.map((x, k) => (x + high[k] + 2) / 4 - size / 2), size]; // left, top, size, of the film
  }

  function aim(panel, camera = viewer.camera) { // at a panel: the narrower direction has the same field of view everywhere
    const [, , w, h] = panel.rect;
    camera.aspect = w / h;
    camera.fov = 2 * Math.atan(Math.tan(FIELD / 2) / Math.min(1, camera.aspect)) * 180 / Math.PI;
    let [left, top, size] = panel.part || [0, 0, 1];
    if (panel.part && panel.body && player.follow) { // in the middle, twice as large
      camera.clearViewOffset();
      const middle = panel.body.object.getWorldPosition(new THREE.Vector3()).project(camera);
      size /= 2;
      [left, top] = [(middle.x + 1 - size) / 2, (1 - middle.y - size) / 2];
    }
    camera.setViewOffset(w, h, left * w, top * h, size * w, size * h);
  }

  const round = (x) => { // 1, 2 or 5 times a power of ten, not above x
    const decade = 10 ** Math.floor(Math.log10(x));
    return decade * [5, 2, 1].find((n) => n * decade <= x * (1 + 1e-9));
  };

  function measured(panel, height) { // a bar in the caption, of a round length at the distance of the middle
    if (!panel.ruler) return;
    const pixels = height / 2 * camera.projectionMatrix.elements[5] / camera.position.distanceTo(controls.target) / panel.ruler;
    const length = round(100 / pixels), [, bar, text] = panel.caption.childNodes;
    bar.style.width = length * pixels + "px";
    text.data = Number(length.toPrecision(1)) + (scene.length && " " + scene.length);
  }

  function lay(panel) { // the floor below all that its content does, with squares of a round size; shadows fall on it
    const group = new THREE.Group(), box = new THREE.Box3().setFromPoints(panel.extent);
    const unit = panel.ruler || 1, square = round(0.25 * unit) / unit, middle = box.getCenter(new THREE.Vector3());
    const { x, z } = box.getSize(new THREE.Vector3()), reach = 0.65 * Math.hypot(x, z) + square;
    const points = [], colors = [], line = new THREE.Color(tone("--line")), many = Math.ceil(reach / square);
    for (let i = -many; i <= many; i++) for (let j = -many; j < many; j++) for (const [x, y] of [[i, j], [i, j + 1], [j, i], [j + 1, i]]) {
      points.push(x * square, y * square, 0);
      paper.clone().lerp(line, Math.max(0, 1 - Math.hypot(x, y) * square / reach)).toArray(colors, colors.length);
    }
    const grid = new THREE.BufferGeometry();
    for (const [name, array] of Object.entries({ position: points, color: colors })) grid.setAttribute(name, new THREE.Float32BufferAttribute(array, 3));
    const plane = new THREE.Mesh(new THREE.PlaneGeometry(4 * reach, 4 * reach), new THREE.ShadowMaterial({ opacity: dark ? 0.6 : 0.22 }));
    plane.receiveShadow = true;
    group.add(new THREE.LineSegments(grid, new THREE.LineBasicMaterial({ vertexColors: true })), plane);
    group.position.set(square * Math.round(middle.x / square), -square * Math.round(middle.z / square), (panel.floor === true ? box.min.y : panel.floor) - 0.012); // below trails
    panel.object.add(group);
  }

  function drawAxes() { // the directions of the scene's axes on the screen
    const ends = ["x", "y", "z"].map((name, k) => {
      const v = new THREE.Vector3().setComponent(k, 1).transformDirection(viewer.scene.matrixWorld).transformDirection(camera.matrixWorldInverse);
      return [name, v.x.toFixed(3), (-v.y).toFixed(3)];
    });
    $("axes").innerHTML = ends.map(([name, x, y]) => `<line x2="${26 * x}" y2="${26 * y}"/>` +
      (Math.hypot(x, y) > 0.4 ? `<text x="${35 * x}" y="${35 * y}">${name}</text>` : "")).join("");
  }

  const right = new THREE.Vector3(), up = new THREE.Vector3();
  let drawn = 0;
  function draw() {
    viewer.needs_render = false;
    drawn++;
    camera.updateMatrixWorld();
    right.setFromMatrixColumn(camera.matrixWorld, 0);
    up.setFromMatrixColumn(camera.matrixWorld, 1);
    if (scene.axes) drawAxes();
    const away = camera.position.distanceTo(controls.target);
    // lights are children of the scene, whose third axis is up
    lamp.position.copy(camera.position).addScaledVector(up, 0.7 * away).addScaledVector(right, -0.5 * away);
    viewer.scene.worldToLocal(lamp.position);
    rim.position.copy(lamp.position).multiplyScalar(-1);
    lamp.target.position.copy(controls.target);
    viewer.scene.worldToLocal(lamp.target.position);
    lamp.target.updateMatrixWorld();
    const height = pane.clientHeight;
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    for (const panel of shown) {
      for (const other of panels) other.object.visible = other === panel;
      const [x, y, w, h] = panel.rect;
      renderer.setViewport(x, height - y - h, w, h);
      renderer.setScissor(x, height - y - h, w, h);
      aim(panel);
      renderer.shadowMap.needsUpdate = panel.floor !== false;
      measured(panel, h);
      letters.forEach((letter) => resize(letter, h));
      renderer.render(viewer.scene, camera);
    }
    for (const panel of panels) panel.object.visible = true;
  }

  // ---------------------------------------------------------------- motion

  const setters = {
    position: (object, v) => object.position.fromArray(v),
    quaternion: (object, v) => object.quaternion.fromArray(v),
    direction: (object, v) => object.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), new THREE.Vector3().fromArray(v).normalize()),
    scale: (object, v) => object.scale.setScalar(v[0]),
    tones: (object, v) => { // of the points of a surface
      const rows = new Float32Array(3 * v.length);
      v.forEach((tone, k) => toned(tone, object.userData.colors).toArray(rows, 3 * k));
      object.geometry.setAttribute("color", new THREE.BufferAttribute(rows, 3));
    },
  };

  // what is there many times, and moves: its places, and its arrows or turns
  const moved = new Set();
  for (const name of ["cloud", "vectors", "turns"]) setters[name] = (object, v) => { object.userData[name] = v; moved.add(object); };
  const inner = [...Object.keys(setters).slice(4), "reveal"]; // what belongs to the object, not to its place
  const p = new THREE.Vector3(), q = new THREE.Quaternion(), s = new THREE.Vector3(), d = new THREE.Vector3();
  const third = new THREE.Vector3(0, 0, 1), matrix = new THREE.Matrix4(), paint = new THREE.Color(), hue = new THREE.Color();
  const toned = (tone, colors) => paint.fromArray(colors[1]).lerp(hue.fromArray(colors[tone < 0 ? 0 : 2]), Math.abs(tone));
  function place(object) {
    const { count, sizes, cloud, vectors, turns, colors, axis, tints } = object.userData;
    const each = sizes.length > 3 ? 3 : 0;
    for (let k = 0; k < count; k++) {
      p.fromArray(cloud, 3 * k);
      s.fromArray(sizes, each * k);
      if (turns) q.fromArray(turns, 4 * k);
      if (vectors) {
        const length = d.fromArray(vectors, 3 * k).length();
        q.setFromUnitVectors(third, d.divideScalar(length || 1));
        s.multiplyScalar(length);
      }
      object.setMatrixAt(k, matrix.compose(p, q, s));
      if (colors) object.setColorAt(k, toned(d.x * axis[0] + d.y * axis[1] + d.z * axis[2], colors));
      else if (tints) object.setColorAt(k, paint.fromArray(tints, 3 * k));
    }
    object.instanceMatrix.needsUpdate = true;
    if (object.instanceColor) object.instanceColor.needsUpdate = true;
  }
  const placeAll = () => { moved.forEach(place); moved.clear(); };

  const tracks = scene.tracks.map((track) => {
    const found = node(track.path), object = (inner.includes(track.channel) ? found.children["<object>"] : found).object;
    return { ...track, object, times: scene.clocks[track.clock], now: new Array(track.width || 0) };
  });

  const moving = tracks.filter(({ values, width }) => !values || values.length > width);
  tracks.forEach((track) => move(track, 0));
  placeAll();

  for (const track of tracks.filter(({ channel }) => channel === "reveal")) { // what is long past is pale and thin
    track.head = { value: 0 };
    track.object.material.onBeforeCompile = (shader) => { // one program for all trails: what differs is a uniform
      const along = { value: track.object.geometry.type === "SphereGeometry" ? 1 : 0 }; // balls become smaller, sticks thinner
      Object.assign(shader.uniforms, { head: track.head, tail: { value: 0.35 * track.times.length }, least: { value: track.least }, along });
      shader.vertexShader = "varying float fresh; uniform float head, tail, least, along;\n" + shader.vertexShader.replace("#include <begin_vertex>",
        "#include <begin_vertex>\nfresh = clamp(1.0 - (head - float(gl_InstanceID)) / tail, least, 1.0);\ntransformed *= vec3(fresh, fresh, mix(1.0, fresh, along));")
        .replace("#include <project_vertex>", "#include <project_vertex>\ngl_Position.z += 4e-4 * (1.0 - fresh) * gl_Position.w;"); // the newer lap is in front
      shader.fragmentShader = "varying float fresh;\n" + shader.fragmentShader.replace("#include <dithering_fragment>",
        `#include <dithering_fragment>\ngl_FragColor.rgb = mix(vec3(${paper.toArray().map((c) => c.toFixed(3))}), gl_FragColor.rgb, fresh);`);
    };
  }

  function behind(times, t) { // the last sample that is not after t
    let low = 0, high = times.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle; else high = middle;
    }
    return low;
  }

  function move(track, t) {
    const { times, values, width, now, object, channel, unit = 1 } = track;
    const i = values && values.length === width ? 0 : behind(times, t); // it may stand still
    if (channel === "reveal") {
      object.count = track.first + i;
      if (track.head) track.head.value = i;
      return;
    }
    let f = 0;
    if (scene.joined[track.clock] && (i + 1) * (width || 1) < (values || times).length && t > times[i]) f = (t - times[i]) / (times[i + 1] - times[i]);
    const a = i * width, b = f > 0 ? a + width : a;
    if (channel === "quaternion") {
      THREE.Quaternion.slerpFlat(now, 0, values, a, values, b, f);
    } else {
      const box = channel === "cloud" && object.userData.box; // out on one side, in on the other
      for (let k = 0; k < width; k++) {
        let step = values[b + k] - values[a + k];
        if (box) step -= box[k % 3] / unit * Math.round(step * unit / box[k % 3]);
        now[k] = unit * (values[a + k] + f * step);
      }
    }
    if (f > 0 && (channel === "vectors" || channel === "turns")) { // lengths change evenly
      const n = channel === "turns" ? 4 : 3;
      for (let k = 0; k < width; k += n) {
        let first = 0, second = 0, mixed = 0;
        for (let i = k; i < k + n; i++) { first += values[a + i] ** 2; second += values[b + i] ** 2; mixed += now[i] ** 2; }
        const longer = mixed > 0 ? unit * ((1 - f) * Math.sqrt(first) + f * Math.sqrt(second)) / Math.sqrt(mixed) : 0;
        for (let i = k; i < k + n; i++) now[i] *= longer;
      }
    }
    setters[channel](object, now);
  }

  // ---------------------------------------------------------------- time

  const rate = scene.duration / scene.seconds || 0; // time of the motion in a second of playing, at speed 1
  const clock = (t) => "t = " + t + (scene.unit && " " + scene.unit);
  const digits = scene.duration > 0 ? Math.max(0, Math.min(12, 3 - Math.ceil(Math.log10(scene.duration)))) : 3;
  const player = {
    duration: scene.duration, time: 0, playing: false, loop: false, follow: false, speed: 1, viewer, panels, tracks, aim,
    get drawn() { return drawn; },
    seek(t) {
      this.time = Math.max(0, Math.min(scene.duration, t));
      for (const track of moving) move(track, this.time);
      placeAll();
      $("time").value = this.time;
      $("label").textContent = $("time").ariaValueText = clock((scene.start + scene.sign * this.time).toFixed(digits));
      for (const now of document.querySelectorAll(".now")) now.setAttribute("transform", `translate(${this.time / scene.duration})`);
      viewer.needs_render = true;
    },
    play() {
      if (!(scene.duration > 0)) return;
      if (this.time >= scene.duration) this.seek(0);
      this.playing = true;
      face();
    },
    pause() { this.playing = false; face(); if (film?.state === "recording") film.stop(); },
    toggle() { if (this.playing) this.pause(); else this.play(); },
    reset() { controls.reset(); layout(); }, // the eye goes back to where it was
    bare() { // nothing but the pictures, standing still
      this.pause();
      document.body.classList.add("bare");
      layout();
    },
    draw,
  };
  window.player = player;
  window.seekTo = (t) => { player.pause(); player.seek(t); };

  function face() {
    const act = player.playing ? "pause" : "play";
    Object.assign($("play"), { ariaLabel: act, title: act + " (space)", className: act });
  }

  // a link is the address of the page with the time and the view, as in Scene(view=), and how far away the eye is
  function link() {
    const { radius, phi, theta } = new THREE.Spherical().setFromVector3(camera.position.clone().sub(controls.target));
    const view = [theta / DEGREE - 90, 90 - phi / DEGREE].map((a) => a.toFixed(1)), t = $("label").textContent.match(/[-\d.]+/);
    history.replaceState(null, "", `${location.href.split("#")[0]}#t=${t}&view=${view},${(radius / distance).toFixed(3)}`);
    const told = (how) => say(`The address of this moment and view${how}:\n${location.href}`);
    (navigator.clipboard ? navigator.clipboard.writeText(location.href) : Promise.reject()).then(() => told(", copied"), () => told(""));
  }

  function arrive() { // by a link
    const { t, view } = Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
    const eye = (view ?? "").split(",").map(Number), known = t && Number.isFinite(Number(t));
    if (eye.length > 1 && eye.every(Number.isFinite) && eye[2] !== 0) look(...eye.slice(0, 3)); // else it is nobody's link
    if (known) window.seekTo(scene.sign * (Number(t) - scene.start));
    return Boolean(known);
  }

  let film = null; // one that is being made
  function record() { // the canvas, from the first moment to the last or until it is stopped
    if (film) return player.pause();
    const parts = [];
    player.seek(0);
    film = new MediaRecorder(renderer.domElement.captureStream(), { videoBitsPerSecond: 1e7 });
    film.ondataavailable = ({ data }) => parts.push(data);
    film.onstop = () => {
      const { mimeType } = film, href = URL.createObjectURL(new Blob(parts, { type: mimeType }));
      Object.assign(document.createElement("a"), { href, download: `${scene.title || "liemech"}.${mimeType.includes("mp4") ? "mp4" : "webm"}` }).click();
      film = null;
      $("film").ariaPressed = false;
    };
    $("film").ariaPressed = true;
    film.start();
    player.play();
  }

  let last = null;
  function frame(now) {
    if (player.playing) {
      // a hidden page gets no frames: do not jump when it is seen again
      if (last !== null) player.seek(player.time + Math.min((now - last) / 1000, 0.25) * rate * player.speed);
      if (player.time >= scene.duration) player.loop && !film ? player.seek(0) : player.pause();
    }
    last = now;
    if (viewer.needs_render) draw();
    requestAnimationFrame(frame);
  }

  // ---------------------------------------------------------------- the bar, the keys

  const ink = (color) => paint.fromArray(night(paint.set(color).toArray())).getStyle();
  for (const name of new Set(scene.courses.map((course) => course.name))) { // how quantities differ from their first values
    const courses = scene.courses.filter((course) => course.name === name), strip = $("courses").appendChild(document.createElement("div"));
    const most = courses.reduce((m, { values }) => values.reduce((a, b) => Math.max(a, Math.abs(b)), m), 0);
    const scale = Math.max(most, ...courses.map(({ rounding }) => 20 * rounding)) || 1; // rounding is no drift
    const curve = ({ run, color, values }) => `<polyline class="run${run}" stroke="${ink(color)}" points="${[...values].map((y, k) => [scene.clocks[run][k] / scene.duration, -y / scale])}"/>`;
    strip.innerHTML = `<svg viewBox="0 -1.1 1 2.2" preserveAspectRatio="none" aria-hidden="true">${courses.map(curve).join("")}<path class="now" d="M0 -2 V2"/></svg><span></span>`;
    strip.lastChild.textContent = `${name}: first value \u00b1 ${Number(most.toPrecision(2))}`;
    strip.onclick = ({ offsetX }) => window.seekTo(offsetX / strip.clientWidth * scene.duration);
  }
  if (scene.title) $("head").querySelector("h1").textContent = scene.title; else $("head").querySelector("h1").remove();
  for (const { name, color, colors, line, run, ends = ["", ""] } of scene.legend) {
    const entry = document.createElement(run === undefined ? "span" : "button"), dot = document.createElement("i");
    if (run !== undefined) {
      Object.assign(entry, { title: "hide or show this run", ariaPressed: true });
      entry.onclick = () => { hide(run); entry.ariaPressed = !hidden.has(run); };
    }
    dot.style.background = colors ? `linear-gradient(90deg, ${colors.map(ink)})` : ink(color);
    dot.className = colors ? "scale" : line ? "line" : "";
    entry.append(...(colors ? [name, " ", ends[0], dot, ends[1]] : [dot, name]));
    $("legend").append(entry);
  }
  $("notes").textContent = scene.notes.join("; ");
  for (const speed of [0.1, 0.25, 0.5, 1, 2, 5]) {
    $("speed").add(new Option((scene.unit ? "" : "t: ") + Number((rate * speed).toPrecision(2)) + (scene.unit && " " + scene.unit) + " per second", speed, speed === 1, speed === 1));
  }
  $("time").max = scene.duration;
  if (!(scene.duration > 0)) $("bar").style.display = "none";
  for (const id of ["loop", "follow"]) $(id).onclick = () => { $(id).ariaPressed = player[id] = !player[id]; viewer.needs_render = true; };
  for (const panel of panels) panel.body = moving.find(({ path, channel }) => channel === "position" && path.startsWith(panel.path + "/") && path.endsWith("/body"));
  $("follow").hidden = !panels.some(({ body }) => body);
  $("reset").onclick = () => player.reset();
  $("link").onclick = link;
  $("film").onclick = record;
  $("film").hidden = !window.MediaRecorder;
  $("message").onclick = () => { $("message").style.display = "none"; };
  addEventListener("hashchange", arrive);
  $("full").onclick = () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()).catch(say);
  $("full").hidden = !document.fullscreenEnabled;
  $("play").onclick = () => { player.toggle(); $("play").blur(); };
  $("time").oninput = () => window.seekTo(Number($("time").value));
  $("speed").onchange = () => { player.speed = Number($("speed").value); };
  addEventListener("keydown", (event) => {
    const { tagName } = event.target; // what has the focus has its own keys
    if (event.ctrlKey || event.altKey || event.metaKey || tagName === "SELECT" || (tagName === "BUTTON" && event.key === " ")) return;
    const times = scene.clocks[0], sample = (n) => window.seekTo(times[Math.max(0, Math.min(times.length - 1, behind(times, player.time) + n))]);
    const faster = (n) => { $("speed").selectedIndex = Math.max(0, Math.min($("speed").length - 1, $("speed").selectedIndex + n)); $("speed").onchange(); };
    const step = scene.duration / (event.shiftKey ? 600 : 60);
    const answers = {
      " ": () => player.toggle(),
      ArrowLeft: () => window.seekTo(player.time - step), ArrowRight: () => window.seekTo(player.time + step),
      Home: () => window.seekTo(0), End: () => window.seekTo(scene.duration),
      ",": () => sample(-1), ".": () => sample(1), "+": () => faster(1), "-": () => faster(-1),
      "?": () => { if ($("message").style.display === "block") $("message").click(); else say($("keys").textContent.trim()); },
    };
    const buttons = { l: "loop", c: "follow", r: "reset", k: "link", w: "film", f: "full" };
    const answer = answers[event.key] || (buttons[event.key] && (() => $(buttons[event.key]).click()));
    if (answer) (answer(), event.preventDefault());
  });
  controls.addEventListener("change", () => { viewer.needs_render = true; });
  addEventListener("resize", layout);
  new ResizeObserver(layout).observe($("foot"));

  // ---------------------------------------------------------------- states that come one by one

  if (scene.socket) listen();

  function listen() {
    const trails = new Map(), MOST = 2000;
    for (const id of ["play", "time", "speed", "loop", "link", "film"]) $(id).style.display = "none"; // there is no way back
    const connection = new WebSocket(scene.socket);
    connection.onclose = () => { $("label").textContent += " (ended)"; };
    connection.onmessage = (message) => {
      const update = JSON.parse(message.data);
      for (const [path, channels] of Object.entries(update.nodes)) {
        const found = node(path);
        for (const [channel, value] of Object.entries(channels)) {
          const { object } = inner.includes(channel) ? found.children["<object>"] : found;
          setters[channel](object, Array.isArray(value) ? value : [value]);
        }
      }
      placeAll();
      for (const [path, points] of Object.entries(update.trails)) {
        if (!trails.has(path)) trails.set(path, newTrail(path, update.colors[path]));
        trails.get(path)(points);
      }
      $("bar").style.display = "flex";
      $("label").textContent = clock(update.t.toPrecision(6));
      window.updates = (window.updates || 0) + 1;
      viewer.needs_render = true;
    };

    function newTrail(path, color) { // the last points of a moving one, each in the place of the oldest
      const object = new THREE.InstancedMesh(new THREE.SphereGeometry(0.012, 8, 6), new THREE.MeshBasicMaterial({ color }), MOST);
      object.frustumCulled = false;
      node(path).object.add(object);
      let count = 0;
      return (points) => {
        for (const point of points) object.setMatrixAt(count++ % MOST, matrix.makeTranslation(...point));
        object.count = Math.min(count, MOST);
        object.instanceMatrix.needsUpdate = true;
      };
    }
  }

  controls.saveState();
  if (!scene.socket) measure();
  panels.filter(({ floor }) => floor !== false).forEach(lay);
  layout();
  player.seek(0);
  requestAnimationFrame(frame);
  if (!arrive() && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.play();
  face();
  window.ready = true;
}
