// A vehicle with its cable and load. All coordinates are NED metres; the vehicle's own parts are in its body
// frame (forward, right, down).
"use strict";
(() => {
  const CABLE_POINTS = 25;
  const BLADE_TURNS_PER_S = 2.6; // of a rotor at its limit; the eye could not follow the true speed

  function mesh(geometry, colour, options) {
    return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: colour, ...options }));
  }

  /** A cylinder of `radius` from `a` to `b`. */
  function strut(a, b, radius, colour) {
    const from = new THREE.Vector3(...a), to = new THREE.Vector3(...b);
    const part = mesh(new THREE.CylinderGeometry(radius, radius, from.distanceTo(to), 10), colour);
    part.position.copy(from).add(to).multiplyScalar(0.5);
    part.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.sub(from).normalize());
    return part;
  }

  class Craft {
    constructor(world, layout, theme) {
      this.layout = layout;
      this.world = world;
      this.points = new Float32Array(3 * CABLE_POINTS);
      this.angles = layout.rotors.map(() => 0);
      this.time = null;
      this.build(theme);
    }

    build(theme) {
      this.theme = theme;
      const size = this.layout.armLength;
      this.group = new THREE.Group();
      this.body = new THREE.Group();
      this.group.add(this.body);
      this.buildBody(size, theme);
      this.load = mesh(new THREE.SphereGeometry(0.36 * size, 28, 18), theme.load);
      this.group.add(this.load);
      this.shadows = [1.0, 0.36].map((share) => {
        const flat = new THREE.MeshBasicMaterial({ color: theme.shadow, transparent: true, depthWrite: false });
        const shadow = new THREE.Mesh(new THREE.CircleGeometry(share * size, 28), flat);
        shadow.rotation.x = Math.PI; // faces up, which is -D
        shadow.renderOrder = 1;
        this.group.add(shadow);
        return shadow;
      });
      this.cable = new THREE.Line2(
        new THREE.LineGeometry(), new THREE.LineMaterial({ color: theme.cable, linewidth: 2.4 }));
      this.cable.frustumCulled = false;
      this.group.add(this.cable);
      this.plumb = new THREE.Line(
        new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3)),
        new THREE.LineBasicMaterial({ color: theme.gridMajor, transparent: true, opacity: 0.9 }));
      this.plumb.frustumCulled = false;
      this.group.add(this.plumb);
      this.asked = new THREE.Mesh(
        new THREE.TorusGeometry(0.62 * size, 0.045 * size, 8, 36), new THREE.MeshBasicMaterial({ color: theme.target }));
      this.group.add(this.asked);
      this.world.add(this.group);
    }

    buildBody(size, theme) {
      const hull = mesh(new THREE.SphereGeometry(0.34 * size, 28, 16), theme.hull);
      hull.scale.set(1.35, 0.8, 0.42);
      const nose = mesh(new THREE.SphereGeometry(0.12 * size, 18, 12), theme.nose);
      nose.position.set(0.42 * size, 0, 0);
      this.body.add(hull, nose);
      const radius = 0.62 * size;
      this.rotors = this.layout.rotors.map((rotor) => {
        const [x, y, z] = rotor.position;
        const top = z - 0.16 * size;
        const front = x > 0;
        this.body.add(strut([0, 0, 0], [x, y, z], 0.05 * size, front ? theme.nose : theme.arm));
        this.body.add(strut([x, y, z + 0.05 * size], [x, y, top], 0.085 * size, theme.motor));
        this.body.add(strut([0.8 * x, 0.8 * y, z], [0.95 * x, 0.95 * y, z + 0.32 * size], 0.025 * size, theme.arm));
        const disc = new THREE.Mesh(
          new THREE.CircleGeometry(radius, 40),
          new THREE.MeshBasicMaterial({ color: theme.rotor, transparent: true, opacity: 0.12, side: THREE.DoubleSide, depthWrite: false }));
        const rim = new THREE.Mesh(
          new THREE.TorusGeometry(radius, 0.012 * size, 6, 48), new THREE.MeshBasicMaterial({ color: theme.rotor }));
        const blades = new THREE.Group();
        for (const side of [0, Math.PI]) {
          const blade = mesh(new THREE.CylinderGeometry(0.035 * size, 0.075 * size, radius, 8), theme.rotor);
          blade.scale.z = 0.25;
          blade.rotation.z = side;
          blade.position.set(-Math.sin(side) * 0, Math.cos(side) * radius * 0.5, 0);
          blades.add(blade);
        }
        for (const part of [disc, rim, blades]) {
          part.position.set(x, y, top);
          this.body.add(part);
        }
        return { disc, rim, blades, spin: rotor.spin };
      });
    }

    setTheme(theme) {
      this.dispose();
      this.build(theme);
    }

    /** Moves all parts to the state `vehicle` (see Scene.show); `ground` is D of the ground. */
    show(vehicle, time, ground) {
      const [n, e, d] = vehicle.position;
      const [w, x, y, z] = vehicle.attitude;
      this.body.position.set(n, e, d);
      this.body.quaternion.set(x, y, z, w);
      this.turn(vehicle.rotors, time);
      const load = vehicle.load;
      this.load.visible = Boolean(load && load.position);
      this.cable.visible = this.load.visible && load.attached !== false;
      this.placeShadow(this.shadows[0], n, e, d, ground);
      this.shadows[1].visible = this.plumb.visible = this.load.visible;
      if (this.load.visible) {
        this.load.position.set(...load.position);
        this.load.material.color.set(vehicle.colour || (load.attached === false ? this.theme.loadFree : this.theme.load));
        this.placeShadow(this.shadows[1], ...load.position, ground);
        const line = this.plumb.geometry.attributes.position;
        line.setXYZ(0, ...load.position);
        line.setXYZ(1, load.position[0], load.position[1], ground);
        line.needsUpdate = true;
      }
      if (this.cable.visible) this.hang(vehicle, ground);
      this.asked.visible = Boolean(vehicle.asked);
      if (vehicle.asked) this.asked.position.set(...vehicle.asked);
    }

    turn(use, time) {
      const dt = this.time === null ? 0 : Math.min(Math.max(time - this.time, 0), 0.1);
      this.time = time;
      this.rotors.forEach((rotor, index) => {
        const share = use && Number.isFinite(use[index]) ? Math.max(use[index], 0) : 0;
        this.angles[index] += rotor.spin * 2 * Math.PI * BLADE_TURNS_PER_S * Math.sqrt(share) * dt;
        rotor.blades.rotation.z = this.angles[index];
        const colour = share > 0.95 ? this.theme.rotorFull : this.theme.rotor;
        rotor.disc.material.color.set(colour);
        rotor.disc.material.opacity = 0.06 + 0.3 * Math.min(share, 1);
        rotor.rim.material.color.set(colour);
      });
    }

    placeShadow(shadow, n, e, d, ground) {
      const height = Math.max(ground - d, 0);
      shadow.position.set(n, e, ground - 0.004);
      const spread = 1 + 0.12 * height;
      shadow.scale.set(spread, spread, 1);
      shadow.material.opacity = 0.42 / (spread * spread);
    }

    /** Draws the cable: a straight line while taut, else a curve as long as the cable. */
    hang(vehicle, ground) {
      const a = vehicle.position, b = vehicle.load.position;
      const slack = vehicle.taut === false;
      this.bend(a, b, slack ? sagOf(a, b, vehicle.cableLength || this.layout.cableLength) : [0, 0, 0], ground - 0.006);
      this.cable.geometry.setPositions(this.points);
      this.cable.material.color.set(slack ? this.theme.slack : this.theme.cable);
    }

    bend(a, b, sag, ground) {
      for (let i = 0; i < CABLE_POINTS; i += 1) {
        const t = i / (CABLE_POINTS - 1);
        for (let axis = 0; axis < 3; axis += 1) {
          this.points[3 * i + axis] = a[axis] * (1 - t) + b[axis] * t + sag[axis] * 4 * t * (1 - t);
        }
        this.points[3 * i + 2] = Math.min(this.points[3 * i + 2], ground);
      }
    }

    dispose() {
      this.world.remove(this.group);
      this.group.traverse((part) => {
        if (part.geometry) part.geometry.dispose();
        if (part.material) part.material.dispose();
      });
    }
  }

  /** The vector from the middle between the ends a and b to the middle of a curve of this length. */
  function sagOf(a, b, length) {
    const chord = b.map((value, axis) => value - a[axis]);
    if (!(length > Math.hypot(...chord))) return [0, 0, 0];
    // downward and sideways, along the horizontal normal of the chord, so that a steep cable shows a loop
    const flat = Math.hypot(chord[0], chord[1]);
    const side = flat > 1e-3 ? [-chord[1] / flat, chord[0] / flat] : [0, 1];
    const direction = [0.5 * side[0], 0.5 * side[1], 0.87];
    let low = 0, high = length;
    for (let step = 0; step < 12; step += 1) {
      const middle = 0.5 * (low + high);
      if (curveLength(chord, direction, middle) > length) high = middle;
      else low = middle;
    }
    return direction.map((component) => component * low);
  }

  function curveLength(chord, direction, sag) {
    let sum = 0;
    for (let i = 0; i < 12; i += 1) {
      const slope = 4 * sag * (1 - (2 * i + 1) / 12);
      sum += Math.hypot(...chord.map((value, axis) => value + slope * direction[axis])) / 12;
    }
    return sum;
  }

  Plumbline.SceneCraft = Craft;
})();
