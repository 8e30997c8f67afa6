// What the page does beyond being read: a model that turns, elements that can be chosen, matrices to copy.
// Nothing here is needed to read the page; without it the picture and the tables stay.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const DURATION_MS = 900;

  document.documentElement.classList.add("scripted");
  for (const element of document.querySelectorAll(".needs-script")) element.hidden = false;

  // Matrices to copy

  async function copy(index) {
    const text = JSON.stringify(data.elements[index].matrix);
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      const area = document.body.appendChild(document.createElement("textarea"));
      area.value = text;
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    byId("said").textContent = "Matrix copied";
  }

  document.addEventListener("click", (event) => {
    const button = event.target.closest("[data-copy]");
    if (!button) return;
    copy(Number(button.dataset.copy));
    button.textContent = "copied";
    setTimeout(() => { button.textContent = "copy"; }, 1500);
  });

  // Choosing an element: in the list, in the scene, or nothing

  // Of two objects there is always a map that is chosen; `way` is the part of it that is gone through.
  const pair = data.moving !== undefined;
  let view = null, chosen = -1, started = 0, way = [0, 1], at = 1;

  function choose(index, animated = true) {
    chosen = pair ? Math.max(0, index) : index === chosen ? -1 : index;
    for (const button of document.querySelectorAll("[data-choose]")) {
      const own = Number(button.dataset.choose) === chosen;
      button.setAttribute("aria-pressed", String(own));
      button.closest("tr").classList.toggle("chosen", own);
    }
    byId("card").hidden = chosen < 0;
    view.choose(chosen);
    if (chosen < 0) return;
    const element = data.elements[chosen];
    byId("chosen").textContent = element.title;
    byId("told").textContent = element.told.replaceAll(" %", "\u00a0%");
    byId("copy").hidden = element.matrix === null;
    go(0, 1, animated);
  }

  function go(from, to, animated = true) {
    way = [from, to];
    started = animated && !still.matches ? performance.now() : -DURATION_MS;
    requestAnimationFrame(advance);
  }

  function advance(now) {
    const share = Math.min(1, Math.max(0, (now - started) / DURATION_MS));
    morph(way[0] + (way[1] - way[0]) * share * share * (3 - 2 * share));
    if (share < 1 && chosen >= 0) requestAnimationFrame(advance);
  }

  function morph(share) {
    at = share;
    byId("morph").value = share;
    for (const button of document.querySelectorAll("[data-share]")) {
      button.setAttribute("aria-pressed", String(Number(button.dataset.share) === share));
    }
    view.morph(share);
  }

  function listen() {
    document.addEventListener("click", (event) => {
      const button = event.target.closest("[data-choose]");
      if (!button) return;
      choose(Number(button.dataset.choose));
      const box = byId("viewer").getBoundingClientRect();
      if (box.bottom < 120 || box.top > innerHeight - 120) {
        byId("viewer").scrollIntoView({ block: "center", behavior: still.matches ? "auto" : "smooth" });
      }
    });
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && chosen >= 0 && !pair) choose(-1);
    });
    byId("morph").addEventListener("input", () => {
      started = -DURATION_MS;
      way = [0, Number(byId("morph").value)];
      morph(way[1]);
    });
    for (const button of document.querySelectorAll("[data-share]")) {
      button.addEventListener("click", () => go(at, Number(button.dataset.share)));
    }
    byId("clear")?.addEventListener("click", () => choose(-1));
    byId("copy").addEventListener("click", () => copy(chosen));
    dark.addEventListener("change", () => view.recolour());
  }

  // Objects in the plane: the image is the same drawing, moved

  function planeView() {
    const drawing = byId("drawing"), image = byId("image");
    drawing.addEventListener("click", (event) => {
      const element = event.target.closest("[data-element]");
      if (element) choose(Number(element.dataset.element));
      else if (chosen >= 0) choose(-1);
    });
    byId("viewer").querySelector("svg").dataset.state = "live";
    document.querySelector(".legend").hidden = true;
    return {
      choose(index) {
        drawing.classList.toggle("choosing", index >= 0);
        for (const element of drawing.querySelectorAll("[data-element]")) {
          element.classList.toggle("chosen", Number(element.dataset.element) === index);
        }
        image.setAttribute("visibility", index < 0 ? "hidden" : "visible");
      },
      morph(share) {
        if (chosen < 0) return;
        const { kind, axis: [x, y], point: [px, py], angle } = data.elements[chosen];
        let a = 1 - 2 * share * x * x, b = -2 * share * x * y, c = b, d = 1 - 2 * share * y * y;
        if (kind === "turn") {
          a = d = Math.cos(share * angle);
          b = Math.sin(share * angle);
          c = -b;
        }
        const e = px - a * px - c * py, f = py - b * px - d * py;
        image.setAttribute("transform", `matrix(${a} ${b} ${c} ${d} ${e} ${f})`);
      },
      recolour() {},
    };
  }

  // Objects in space

  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

  /** The object as the page carries it, in diagonals about the centre. */
  function unpacked(object) {
    const steps = new Uint16Array(bytes(object.positions).buffer);
    const positions = Float32Array.from(steps, (v, k) => object.low[k % 3] + object.step * v);
    const mesh = object.kind !== "cloud";
    const faces = mesh && new (object.wide ? Uint32Array : Uint16Array)(bytes(object.faces).buffer);
    return {
      positions,
      faces,
      mesh,
      normals: mesh ? null : Float32Array.from(new Int8Array(bytes(object.normals).buffer), (v) => v / 127),
      colours: bytes(object.colours),
      misses: bytes(object.misses),
      owners: object.owners ? new Uint16Array(bytes(object.owners).buffer) : null,
      count: object.owners ? null : positions.length / 3,
    };
  }

  // Misses by colour: the object's own, amber, orange, red; green where nobody looked.
  const RAMP = [[0, null], [0.12, null], [0.4, [240, 192, 48]], [0.65, [232, 112, 26]], [1, [200, 30, 70]]];
  const NOT_SEEN = [116, 190, 96];
  const tone = (own) => (own || (dark.matches ? [143, 154, 173] : [168, 178, 194]));

  function heat(step, own, { unseen, steps }) {
    if (step === unseen) return NOT_SEEN;
    const share = step / steps;
    const k = Math.max(1, RAMP.findIndex(([at]) => share <= at));
    const [[low, from], [high, to]] = [RAMP[k - 1], RAMP[k]].map(([at, colour]) => [at, tone(colour ?? own)]);
    const part = (share - low) / (high - low);
    return from.map((v, i) => v + part * (to[i] - v));
  }

  /** A geometry with creases for a mesh, or points with normals; `corner` says which position each vertex shows. */
  function geometryOf(parts) {
    const geometry = new THREE.BufferGeometry();
    if (!parts.mesh) {
      geometry.setAttribute("position", new THREE.BufferAttribute(parts.positions, 3));
      geometry.setAttribute("normal", new THREE.BufferAttribute(parts.normals, 3));
      return { geometry, corner: (k) => k, length: parts.positions.length / 3, part: (k) => k };
    }
    const positions = new Float32Array(3 * parts.faces.length);
    parts.faces.forEach((v, k) => {
      for (let i = 0; i < 3; i++) positions[3 * k + i] = parts.positions[3 * v + i];
    });
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    const creased = THREE.toCreasedNormals(geometry, 0.6);
    const [length, part] = [parts.faces.length, (k) => Math.floor(k / 3)];
    return { geometry: creased, corner: (k) => parts.faces[k], length, part };
  }

  function coloured(length, colourOf, linear) {
    const values = new Float32Array(3 * length), colour = new THREE.Color();
    for (let k = 0; k < length; k++) {
      const rgb = colourOf(k).map((v) => v / 255);
      values.set(linear ? colour.setRGB(...rgb, THREE.SRGBColorSpace).toArray() : rgb, 3 * k);
    }
    return new THREE.BufferAttribute(values, 3);
  }

  // Points are discs, lit on both sides, as large as they are far apart; `nearer` is how far their depth lies ahead of
  // them, so that an image hides what it agrees with but for noise.
  function pointMaterial(radius, nearer) {
    return new THREE.ShaderMaterial({
      uniforms: { pale: { value: 1 }, size: { value: 1 }, radius: { value: radius }, nearer: { value: nearer } },
      vertexShader: `
        attribute vec3 tint; uniform float pale, size, radius, nearer; varying vec3 shade;
        void main() {
          vec4 eye = modelViewMatrix * vec4(position, 1.0);
          vec3 facing = normalMatrix * normal;
          float light = 0.95;
          if (length(facing) > 0.0) light = 0.45 + 0.6 * abs(dot(normalize(facing), normalize(vec3(-0.25, 0.4, 0.88))));
          shade = tint * light * pale;
          gl_Position = projectionMatrix * eye;
          vec4 ahead = projectionMatrix * (eye + vec4(0.0, 0.0, nearer, 0.0));
          gl_Position.z = ahead.z / ahead.w * gl_Position.w;
          gl_PointSize = clamp(2.0 * size * radius / -eye.z, 2.0, 40.0);
        }`,
      fragmentShader: `
        varying vec3 shade;
        void main() {
          vec2 from = gl_PointCoord - 0.5;
          if (dot(from, from) > 0.25) discard;
          gl_FragColor = vec4(min(shade, 1.0), 1.0);
        }`,
    });
  }

  /**
   * The map of an element a share of the way from doing nothing: flattening onto a mirror, turning about an axis; and
   * for what travels, as much of the way from one place to the other.
   */
  function partial({ kind, axis, point, angle, travel }, share) {
    const place = new THREE.Vector3(...point), u = new THREE.Vector3(...axis);
    // From 1 to -1. Half-way nothing would be left that light falls on: it stays a little thick.
    const left = (t) => (Math.abs(1 - 2 * t) < 0.02 ? 0.02 : 1 - 2 * t);
    const flatten = (t) => {
      const [x, y, z] = axis, s = left(t) - 1;
      return new THREE.Matrix4().set(
        1 + s * x * x, s * x * y, s * x * z, 0,
        s * y * x, 1 + s * y * y, s * y * z, 0,
        s * z * x, s * z * y, 1 + s * z * z, 0,
        0, 0, 0, 1);
    };
    const turn = (t) => new THREE.Matrix4().makeRotationAxis(u, t * angle);
    const maps = {
      plane: () => flatten(share),
      axis: () => turn(share),
      improper: () => flatten(Math.max(0, 2 * share - 1)).multiply(turn(Math.min(1, 2 * share))),
      inversion: () => new THREE.Matrix4().makeScale(left(share), left(share), left(share)),
    };
    const back = new THREE.Matrix4().makeTranslation(place.clone().negate());
    const made = new THREE.Matrix4().makeTranslation(place).multiply(maps[kind]()).multiply(back);
    if (!travel) return made;
    const gone = new THREE.Vector3(...travel[0]).lerp(new THREE.Vector3(...travel[1]), share);
    return new THREE.Matrix4().makeTranslation(gone).multiply(made);
  }

  /** The curve in which a plane cuts a mesh. */
  function traceOf({ axis, point }, { positions, faces }) {
    const count = positions.length / 3, height = new Float32Array(count), ends = [];
    for (let v = 0; v < count; v++) {
      for (let i = 0; i < 3; i++) height[v] += axis[i] * (positions[3 * v + i] - point[i]);
      if (height[v] === 0) height[v] = 1e-9;
    }
    for (let f = 0; f < faces.length; f += 3) {
      for (let side = 0; side < 3; side++) {
        const a = faces[f + side], b = faces[f + (side + 1) % 3];
        if (height[a] > 0 === height[b] > 0) continue;
        const share = height[a] / (height[a] - height[b]);
        for (let i = 0; i < 3; i++) ends.push((1 - share) * positions[3 * a + i] + share * positions[3 * b + i]);
      }
    }
    const geometry = new THREE.BufferGeometry();
    return geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(ends), 3));
  }

  function spaceView() {
    const viewer = byId("viewer"), canvas = byId("model"), labels = byId("labels");
    const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(26, 1, 0.01, 100);
    camera.up.set(0, 0, 1);
    const root = scene.add(new THREE.Group()).children[0];
    const [side, front, up] = data.object.frame;
    root.matrixAutoUpdate = false;
    root.matrix.set(...side, 0, ...front, 0, ...up, 0, 0, 0, 0, 1);
    scene.add(new THREE.HemisphereLight(0xffffff, 0xa8b0be, 2.1), camera);
    for (const [power, ...at] of [[1.5, -0.45, 0.75, 0.5], [0.5, 0.9, 0.1, 0.45]]) {
      const lamp = new THREE.DirectionalLight(0xffffff, power);
      lamp.position.set(...at);
      camera.add(lamp, lamp.target);
    }

    const thing = bodyOf(data.object, false), image = bodyOf(data.moving ?? data.object, true, !pair && thing);
    const parts = thing.parts, seen = data.object.seen ?? Infinity;
    const traced = parts.mesh && !parts.owners;
    image.drawn.matrixAutoUpdate = false;
    image.drawn.visible = false;
    image.drawn.frustumCulled = false;
    root.add(thing.drawn, image.drawn);

    /** An object to draw, in its own colours or in those of what it misses; `ahead` of another that it agrees with. */
    function bodyOf(object, ahead, same) {
      const made = same ? same.made : { parts: unpacked(object) };
      if (!same) Object.assign(made, geometryOf(made.parts));
      const { parts, corner, length, part } = made, geometry = same ? made.geometry.clone() : made.geometry;
      const places = parts.owners ? Math.max(...parts.owners) + 1 : parts.positions.length / 3;
      const lit = (shift) => new THREE.MeshLambertMaterial({
        vertexColors: true, side: THREE.DoubleSide,
        polygonOffset: true, polygonOffsetFactor: shift, polygonOffsetUnits: shift,
      });
      const drawn = parts.mesh
        ? new THREE.Mesh(geometry, lit(ahead ? 0 : 1))
        : new THREE.Points(geometry, pointMaterial(object.radius, ahead && !pair ? 0.01 : 0));
      const paint = (colourOf) => {
        geometry.setAttribute(parts.mesh ? "color" : "tint", coloured(length, colourOf, parts.mesh));
      };
      const plain = () => paint((k) => object.palette[parts.colours[part(k)]]);
      function judged(index) {
        const row = parts.misses.subarray(index * places, (index + 1) * places), known = [];
        paint((k) => {
          const at = corner(k), step = row[parts.owners ? parts.owners[at] : at], own = parts.colours[part(k)];
          return (known[256 * own + step] ??= heat(step, pair && object.palette[own], object));
        });
      }
      plain();
      return { made, parts, drawn, plain, judged };
    }

    const shown = data.elements.map((element) => elementOf(element));
    for (const { group } of shown) root.add(group);
    const controls = new THREE.OrbitControls(camera, canvas);
    controls.enablePan = false;
    controls.enableZoom = false;
    let wanted = false, touched = false, told = false, fitted = 1;

    function request() {
      if (wanted) return;
      wanted = true;
      requestAnimationFrame(() => { wanted = false; draw(); });
    }

    function draw() {
      renderer.render(scene, camera);
      nameAll();
    }

    /** What is drawn of an element: a sheet with its edge, or a rod that shines through the object, and its name. */
    function elementOf(element) {
      const group = new THREE.Group(), colour = new THREE.Color(), hits = [];
      const paint = { fills: [], strokes: [] }, sheets = [];
      if (element.corners) {
        const sheet = new THREE.BufferGeometry();
        sheet.setAttribute("position", new THREE.BufferAttribute(new Float32Array(element.corners.flat()), 3));
        const edge = new THREE.LineLoop(sheet, new THREE.LineBasicMaterial());
        const filled = sheet.clone().setIndex([0, 1, 2, 0, 2, 3]);
        const fill = new THREE.Mesh(filled, new THREE.MeshBasicMaterial({
          transparent: true, depthWrite: false, side: THREE.DoubleSide,
        }));
        group.add(fill, edge);
        sheets.push(fill, edge);
        hits.push(fill);
        paint.fills.push(fill.material);
        paint.strokes.push(edge.material);
        if (traced && !element.missed) {
          const trace = new THREE.LineSegments(traceOf(element, parts), new THREE.LineBasicMaterial());
          group.add(trace);
          hits.push(trace);
          paint.strokes.push(trace.material);
        }
      }
      if (element.ends) {
        const [from, to] = element.ends.map((end) => new THREE.Vector3(...end));
        const rod = (radius, options) => {
          const mesh = new THREE.Mesh(
            new THREE.CylinderGeometry(radius, radius, from.distanceTo(to), 10), new THREE.MeshBasicMaterial(options));
          mesh.position.copy(from).lerp(to, 0.5);
          mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.clone().sub(from).normalize());
          group.add(mesh);
          return mesh;
        };
        const solid = rod(0.0042, {});
        const ghost = rod(0.0042, {
          transparent: true, opacity: 0.3, depthFunc: THREE.GreaterDepth, depthWrite: false,
        });
        const reach = rod(0.022, { transparent: true, opacity: 0, depthWrite: false, colorWrite: false });
        hits.push(reach);
        paint.strokes.push(solid.material, ghost.material);
        if (element.mark.length) {
          const sign = new THREE.BufferGeometry();
          sign.setAttribute("position", new THREE.BufferAttribute(new Float32Array(element.mark.flat()), 3));
          const line = new THREE.Line(sign, new THREE.LineBasicMaterial());
          group.add(line);
          paint.strokes.push(line.material);
        }
      }
      const label = labels.appendChild(document.createElement("span"));
      label.textContent = element.missed ? "" : element.label;
      const anchors = (element.corners ?? element.ends?.toReversed() ?? []).map((c) => new THREE.Vector3(...c));
      return { element, group, hits, sheets, paint, label, anchors, colour };
    }

    function recolour() {
      const sheets = shown.filter(({ element, group }) => element.corners && group.visible).length;
      for (const { element, paint, label, colour } of shown) {
        let rgb = element.colour;
        if (!element.corners && !element.missed) rgb = dark.matches ? [236, 240, 246] : rgb;
        else if (dark.matches) rgb = rgb.map((v) => Math.min(255, 0.72 * v + 80));
        colour.setRGB(...rgb.map((v) => v / 255), THREE.SRGBColorSpace);
        for (const material of paint.strokes) material.color.copy(colour);
        for (const material of paint.fills) {
          material.color.copy(colour);
          material.opacity = Math.min(0.26, Math.max(0.1, 0.9 / Math.max(1, sheets)));
        }
        label.style.color = `rgb(${rgb.map(Math.round).join(" ")})`;
      }
      if (chosen >= 0) tell(at > 0.5 || !pair);
      request();
    }

    /** What is missed is told by colour, of two objects once one is laid on the other. */
    function tell(judged) {
      for (const body of pair ? [thing, image] : [image]) judged ? body.judged(chosen) : body.plain();
      told = judged;
    }

    /** Names beside what they name; those that would cover another are left out. */
    function nameAll() {
      const { clientWidth: width, clientHeight: height } = canvas, taken = [];
      const middle = project(new THREE.Vector3(), width, height);
      for (const { group, sheets, label, anchors } of shown) {
        label.hidden = true;
        if (!group.visible || !label.textContent || sheets.some((sheet) => !sheet.visible)) continue;
        const half = 5 + 4.6 * label.textContent.length;
        const places = anchors.map((anchor) => project(anchor, width, height));
        if (sheets.length) places.sort((a, b) => a.z - b.z);
        for (const at of places) {
          const away = Math.hypot(at.x - middle.x, at.y - middle.y) || 1;
          const x = at.x + (half + 4) * (at.x - middle.x) / away, y = at.y + 14 * (at.y - middle.y) / away;
          const inside = x > half && x < width - half && y > 10 && y < height - 10;
          if (!inside || taken.some((t) => Math.abs(t.x - x) < t.half + half && Math.abs(t.y - y) < 19)) continue;
          taken.push({ x, y, half });
          label.hidden = false;
          label.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
          break;
        }
      }
    }

    function project(point, width, height) {
      const p = point.clone().applyMatrix4(root.matrix).project(camera);
      return { x: (0.5 + 0.5 * p.x) * width, y: (0.5 - 0.5 * p.y) * height, z: p.z };
    }

    /** The camera so far away that everything is in view, and nothing is far from its edge. */
    function fit() {
      const outline = data.object.outline.map((p) => new THREE.Vector3(...p));
      if (pair) {
        const map = partial(data.elements[Math.max(0, chosen)], at);
        outline.push(...data.moving.outline.map((p) => new THREE.Vector3(...p).applyMatrix4(map)));
      }
      for (const { element, anchors } of shown) {
        if (element.shown || element.missed) outline.push(...anchors.map((p) => p.clone()));
      }
      // Who has turned the camera keeps its direction, and how much nearer it was brought.
      const from = camera.position.clone().sub(controls.target), nearer = touched ? from.length() / fitted : 1;
      const back = touched ? from.normalize() : new THREE.Vector3(...data.object.view).normalize();
      const right = new THREE.Vector3().crossVectors(camera.up, back).normalize();
      const above = new THREE.Vector3().crossVectors(back, right);
      for (const p of outline) p.applyMatrix4(root.matrix);
      const local = outline.map((p) => [p.dot(right), p.dot(above), p.dot(back)]);
      const tangent = 0.86 * Math.tan(0.5 * camera.fov * Math.PI / 180);
      const [wide, high] = [tangent * camera.aspect, tangent];
      const middle = [0, 1, 2].map((i) => middleOf(local.map((p) => p[i])));
      let distance = 1;
      for (let round = 0; round < 4; round++) {
        const away = local.map((p) => p.map((v, i) => v - middle[i]));
        distance = Math.max(...away.map(([x, y, z]) => z + Math.max(Math.abs(x) / wide, Math.abs(y) / high)));
        for (const i of [0, 1]) middle[i] += distance * middleOf(away.map((p) => p[i] / (distance - p[2])));
      }
      controls.target.set(0, 0, 0);
      [right, above, back].forEach((direction, i) => controls.target.addScaledVector(direction, middle[i]));
      camera.position.copy(controls.target).addScaledVector(back, nearer * distance);
      fitted = distance;
      camera.near = 0.02 * distance;
      camera.far = 10 * distance;
      camera.updateProjectionMatrix();
      controls.minDistance = 0.15 * distance;
      controls.maxDistance = 4 * distance;
      controls.update();
    }

    const middleOf = (values) => 0.5 * (Math.min(...values) + Math.max(...values));

    function resize() {
      const { clientWidth: width, clientHeight: height } = viewer;
      if (!width || !height) return;
      renderer.setPixelRatio(Math.min(2, devicePixelRatio));
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      const size = renderer.getPixelRatio() * height / (2 * Math.tan(0.5 * camera.fov * Math.PI / 180));
      for (const { drawn: { material } } of [thing, image]) if (material.uniforms) material.uniforms.size.value = size;
      if (!touched) fit();
      draw();
    }

    /** One element, or all that fit into one view; of planes that would hide it their curves on the surface. */
    function reveal(index) {
      for (const [k, { element, group, sheets }] of shown.entries()) {
        group.visible = index < 0 ? element.shown || (traced && !element.missed && sheets.length > 0) : k === index;
        for (const sheet of sheets) sheet.visible = index === k || element.shown;
      }
    }

    function display(index) {
      reveal(index);
      image.drawn.visible = index >= 0;
      for (const [body, limit] of [[thing, seen], [image, (data.moving ?? data.object).seen ?? Infinity]]) {
        if (!body.parts.mesh) body.drawn.geometry.setDrawRange(0, index < 0 ? Infinity : limit);
      }
      // Behind its image the object is paler.
      const pale = index < 0 || pair ? 1 : parts.mesh ? (dark.matches ? 0.5 : 1.3) : dark.matches ? 0.8 : 1.15;
      if (parts.mesh) thing.drawn.material.color.setScalar(pale);
      else thing.drawn.material.uniforms.pale.value = pale;
      recolour();
    }

    // The pointer: a drag turns, a click chooses

    const ray = new THREE.Raycaster();
    ray.params.Line.threshold = 0.01;
    let pressed = null;

    function under(event) {
      const box = canvas.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
      ray.setFromCamera(new THREE.Vector2(2 * x - 1, 1 - 2 * y), camera);
      const open = shown.map((s, k) => ({ ...s, k })).filter(({ group }) => group.visible);
      const met = open.flatMap(({ hits, k }) => ray.intersectObjects(hits.filter((h) => h.visible), false)
        .map(({ distance, object }) => ({ distance, k, thin: !object.material.side })));
      met.sort((a, b) => (b.thin - a.thin) || (a.distance - b.distance));
      return met.length ? met[0].k : -1;
    }

    canvas.addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
    canvas.addEventListener("pointercancel", () => { pressed = null; });
    canvas.addEventListener("pointerup", (event) => {
      const from = pressed;
      pressed = null;
      if (!from || Math.hypot(event.clientX - from[0], event.clientY - from[1]) > 5) return;
      pick(under(event));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons) canvas.style.cursor = under(event) < 0 ? "" : "pointer";
    });

    /** A click on what is chosen, or beside everything, shows all again. */
    function pick(index) {
      if (pair) return;
      if (index >= 0 && index !== chosen) choose(index);
      else if (chosen >= 0) choose(-1);
    }

    // The wheel scrolls the page until somebody has turned to the model.
    canvas.addEventListener("focus", () => { controls.enableZoom = true; });
    canvas.addEventListener("blur", () => { controls.enableZoom = false; });
    canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }));
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return; // the browser's own
      const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      const nearer = { "+": 0.9, "=": 0.9, "-": 1 / 0.9 }[event.key];
      if (!turns && !nearer) return;
      event.preventDefault();
      touched = true;
      const from = camera.position.clone().sub(controls.target);
      if (turns) {
        const right = new THREE.Vector3().crossVectors(camera.up, from).normalize();
        const polar = from.angleTo(camera.up);
        const step = Math.min(Math.max(0.09 * turns[1], 0.05 - polar), Math.PI - 0.05 - polar);
        from.applyAxisAngle(right, step).applyAxisAngle(camera.up, 0.09 * turns[0]);
      }
      camera.position.copy(controls.target).add(from.multiplyScalar(nearer ?? 1));
      controls.update();
      request();
    });
    controls.addEventListener("change", request);
    controls.addEventListener("start", () => { touched = true; });
    byId("reset").addEventListener("click", () => { touched = false; resize(); });
    canvas.addEventListener("webglcontextlost", () => {
      viewer.classList.remove("live");
      canvas.hidden = true;
      labels.hidden = true;
      viewer.querySelector(".still").hidden = false;
    });

    viewer.querySelector(".still").hidden = true;
    canvas.hidden = false;
    byId("tools").hidden = false;
    viewer.classList.add("live");
    const misses = `misses by ${Number((100 * data.object.limit).toPrecision(2))} % and more`;
    [byId("least").textContent, byId("most").textContent] = data.legend ?? ["the image meets the object", misses];
    reveal(-1);
    recolour();
    resize();
    new ResizeObserver(resize).observe(viewer);
    viewer.dataset.state = "live";
    return {
      choose: display,
      recolour,
      morph(share) {
        if (chosen < 0) return;
        image.drawn.matrix.copy(partial(data.elements[chosen], share));
        image.drawn.matrixWorldNeedsUpdate = true;
        if (pair && told !== share > 0.5) tell(!told);
        if (pair) fit();
        request();
      },
    };
  }

  const views = { space: spaceView, plane: planeView };
  if (!views[data.kind]) return;
  try {
    view = views[data.kind]();
  } catch (error) {
    byId("viewer").dataset.state = "still";
    console.info("No model that turns here; the picture stays.", error.message);
    for (const button of document.querySelectorAll("[data-choose]")) button.disabled = true;
    return;
  }
  listen();
  // Where nothing was found, the nearest miss says the most; of two objects the map does.
  if (pair || (data.elements.length && data.elements[0].missed)) choose(0, false);
})();
