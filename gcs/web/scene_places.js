// What does not fly: ground, compass, fence, rally points, the commanded place, wind.
"use strict";
(() => {
  const WALL_M = 12; // height of the walls of a fence without a height
  const LEAST_WIND = 0.3; // m/s; an estimate of no wind is never exactly 0
  const STREAKS = 46;

  function segments(points, colour, opacity) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points), 3));
    const material = new THREE.LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity });
    return new THREE.LineSegments(geometry, material);
  }

  /** The ground with its lines, computed per pixel: they fade into the haze and never flicker. */
  function groundMaterial(theme) {
    return new THREE.ShaderMaterial({
      uniforms: {
        ground: { value: new THREE.Color(theme.ground) }, haze: { value: new THREE.Color(theme.background) },
        minor: { value: new THREE.Color(theme.gridMinor) }, major: { value: new THREE.Color(theme.gridMajor) },
        centre: { value: new THREE.Vector2() }, reach: { value: 10 },
      },
      vertexShader: `varying vec2 place;
        void main() {
          vec4 world = modelMatrix * vec4(position, 1.0);
          place = world.xz;
          gl_Position = projectionMatrix * viewMatrix * world;
        }`,
      fragmentShader: `varying vec2 place;
        uniform vec3 ground, haze, minor, major;
        uniform vec2 centre;
        uniform float reach;
        float lines(float step, float width) {
          vec2 at = place / step;
          vec2 blur = fwidth(at);
          vec2 away = abs(fract(at - 0.5) - 0.5);
          vec2 on = 1.0 - smoothstep(blur * width * 0.5, blur * (width * 0.5 + 1.0), away);
          on *= 1.0 - smoothstep(0.15, 0.45, blur); // too dense to be seen as lines
          return max(on.x, on.y);
        }
        void main() {
          vec3 colour = mix(ground, minor, lines(1.0, 0.8));
          colour = mix(colour, major, lines(5.0, 1.0));
          colour = mix(colour, haze, smoothstep(0.25, 1.0, distance(place, centre) / reach));
          gl_FragColor = vec4(colour, 1.0);
          #include <colorspace_fragment>
        }`,
      depthTest: false, depthWrite: false, // below everything, regardless of the resolution of the depth buffer
    });
  }

  /** A word that always faces the camera; `size` is a share of the height of the picture. */
  function label(text, colour, size = 0.034) {
    const canvas = document.createElement("canvas");
    canvas.width = 256;
    canvas.height = 64;
    const pen = canvas.getContext("2d");
    pen.font = "600 40px system-ui, -apple-system, 'Segoe UI', sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = colour;
    pen.fillText(text, 128, 34);
    const material = new THREE.SpriteMaterial({
      map: new THREE.CanvasTexture(canvas), sizeAttenuation: false, depthTest: false, transparent: true });
    const sprite = new THREE.Sprite(material);
    sprite.scale.set(4 * size, size, 1);
    return sprite;
  }

  function remove(group) {
    group.traverse((part) => {
      if (part.geometry) part.geometry.dispose();
      if (part.material) {
        if (part.material.map) part.material.map.dispose();
        part.material.dispose();
      }
    });
    group.removeFromParent();
  }

  class Places {
    constructor(world, theme) {
      this.world = world;
      this.fence = null;
      this.rally = [];
      this.goal = null;
      this.waypoints = [];
      this.arrowSize = 1;
      this.setTheme(theme);
    }

    setTheme(theme) {
      this.theme = theme;
      for (const group of this.groups) {
        if (group) remove(group);
      }
      this.buildGround();
      this.buildWind();
      this.setFence(this.fence);
      this.setRally(this.rally);
      this.setGoal(this.goal);
      this.setWaypoints(this.waypoints);
    }

    get groups() {
      return [
        this.groundGroup, this.fenceGroup, this.rallyGroup, this.goalGroup, this.windGroup, this.waypointGroup];
    }

    buildGround() {
      const group = new THREE.Group();
      this.ground = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), groundMaterial(this.theme));
      this.ground.rotation.x = Math.PI; // faces up, which is -D
      this.ground.renderOrder = -3;
      this.ground.frustumCulled = false;
      group.add(this.ground);
      const north = label("N", this.theme.label);
      north.position.set(1.25, 0, -0.02);
      const arrow = new THREE.Mesh(
        new THREE.ConeGeometry(0.06, 0.2, 14), new THREE.MeshBasicMaterial({ color: this.theme.gridMajor }));
      arrow.rotation.z = -Math.PI / 2;
      arrow.position.set(1, 0, 0);
      const home = new THREE.Mesh(
        new THREE.RingGeometry(0.16, 0.2, 40),
        new THREE.MeshBasicMaterial({ color: this.theme.gridMajor, side: THREE.DoubleSide }));
      home.position.z = -0.002;
      group.add(north, arrow, home);
      this.world.add(group);
      this.groundGroup = group;
    }

    /** Keeps the ground below the target of the camera: `target` in the axes of the scene, `distance` of the camera. */
    spreadGround(target, distance) {
      const reach = 12 * distance + 15;
      this.arrowSize = Math.min(Math.max(distance / 9, 0.25), 6); // appears equally large from near and far
      this.ground.position.set(-target.z, target.x, 0);
      this.ground.scale.set(2 * reach, 2 * reach, 1);
      this.ground.material.uniforms.centre.value.set(target.x, target.z);
      this.ground.material.uniforms.reach.value = reach;
    }

    /** Draws each zone as a wall; see Scene.setFence. */
    setFence(fence) {
      this.fence = fence;
      if (this.fenceGroup) remove(this.fenceGroup);
      const group = new THREE.Group();
      const height = (fence && fence.height) || null;
      const zones = fence ? [...(fence.zones || [])] : [];
      if (fence && fence.radius) zones.push({ kind: "inclusion", centre: [0, 0], radius: fence.radius });
      for (const zone of zones) this.wall(group, zone, height || WALL_M, Boolean(height));
      this.world.add(group);
      this.fenceGroup = group;
    }

    wall(group, zone, height, closed) {
      const colour = zone.kind === "exclusion" ? this.theme.exclusion : this.theme.inclusion;
      const rim = zone.polygon ? zone.polygon.map(([n, e]) => [n, e]) : circle(zone.centre, zone.radius);
      const faces = [], edges = [];
      rim.forEach(([n, e], index) => {
        const [n2, e2] = rim[(index + 1) % rim.length];
        faces.push(n, e, 0, n2, e2, 0, n2, e2, -height, n, e, 0, n2, e2, -height, n, e, -height);
        edges.push(n, e, 0, n2, e2, 0);
        if (closed) edges.push(n, e, -height, n2, e2, -height);
        if (zone.polygon) edges.push(n, e, 0, n, e, -height);
      });
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(faces), 3));
      const material = new THREE.MeshBasicMaterial({
        color: colour, transparent: true, opacity: zone.kind === "exclusion" ? 0.14 : 0.05,
        side: THREE.DoubleSide, depthWrite: false });
      group.add(new THREE.Mesh(geometry, material), segments(edges, colour, 0.8));
    }

    setRally(points) {
      this.rally = points || [];
      if (this.rallyGroup) remove(this.rallyGroup);
      const group = new THREE.Group();
      this.rally.forEach(([n, e, d], index) => {
        const pole = segments([n, e, 0, n, e, Math.min(d, 0) - 0.8], this.theme.rally, 1);
        const flag = new THREE.Mesh(
          new THREE.OctahedronGeometry(0.14), new THREE.MeshLambertMaterial({ color: this.theme.rally }));
        flag.position.set(n, e, Math.min(d, 0) - 0.8);
        const name = label(`R${index + 1}`, this.theme.label);
        name.position.set(n, e, Math.min(d, 0) - 1.15);
        group.add(pole, flag, name);
      });
      this.world.add(group);
      this.rallyGroup = group;
    }

    /** Small marks at the places of the mission, and thin lines from each to the next. */
    setWaypoints(places) {
      this.waypoints = places || [];
      if (this.waypointGroup) remove(this.waypointGroup);
      this.waypointGroup = new THREE.Group();
      this.world.add(this.waypointGroup);
      const between = this.waypoints.slice(1).flatMap((place, index) => [...this.waypoints[index], ...place]);
      if (between.length) this.waypointGroup.add(segments(between, this.theme.asked, 0.45));
      for (const place of this.waypoints.slice(1)) {
        const mark = new THREE.Mesh(
          new THREE.OctahedronGeometry(0.045), new THREE.MeshBasicMaterial({ color: this.theme.asked }));
        mark.position.set(...place);
        this.waypointGroup.add(mark);
      }
    }

    /** A ring with a stem at the place to which the load was commanded; null removes it. */
    setGoal(place) {
      this.goal = place || null;
      if (this.goalGroup) remove(this.goalGroup);
      this.goalGroup = new THREE.Group();
      this.world.add(this.goalGroup);
      if (!place) return;
      const ring = new THREE.Mesh(
        new THREE.TorusGeometry(0.22, 0.012, 8, 48), new THREE.MeshBasicMaterial({ color: this.theme.goal }));
      ring.position.set(...place);
      const [n, e, d] = place;
      const cross = [n - 0.1, e, d, n + 0.1, e, d, n, e - 0.1, d, n, e + 0.1, d, n, e, d, n, e, 0];
      this.goalGroup.add(ring, segments(cross, this.theme.goal, 0.8));
    }

    buildWind() {
      const group = new THREE.Group();
      group.visible = false;
      this.streaks = segments(new Array(6 * STREAKS).fill(0), this.theme.wind, 0.55);
      this.streaks.frustumCulled = false;
      this.seeds = Array.from({ length: 3 * STREAKS }, (_, i) => fraction(Math.sin(i * 12.9898 + 4.1) * 43758.5453));
      this.shaft = new THREE.Mesh(
        new THREE.CylinderGeometry(0.02, 0.02, 1, 10), new THREE.MeshBasicMaterial({ color: this.theme.wind }));
      this.tip = new THREE.Mesh(
        new THREE.ConeGeometry(0.075, 0.22, 16), new THREE.MeshBasicMaterial({ color: this.theme.wind }));
      group.add(this.streaks, this.shaft, this.tip);
      this.world.add(group);
      this.windGroup = group;
      this.drift = [0, 0, 0];
      this.windTime = null;
    }

    /** Streaks that drift around `at`, and an arrow on the ground below it; `wind` in m/s or null. */
    showWind(wind, at, time) {
      const speed = wind ? Math.hypot(...wind) : 0;
      this.windGroup.visible = speed > LEAST_WIND && Boolean(at);
      if (!this.windGroup.visible) return;
      const dt = this.windTime === null ? 0 : Math.min(Math.max(time - this.windTime, 0), 0.1);
      this.windTime = time;
      const size = [5, 5, 2.6];
      const line = this.streaks.geometry.attributes.position;
      for (let axis = 0; axis < 3; axis += 1) this.drift[axis] += (wind[axis] * dt) / size[axis];
      for (let i = 0; i < STREAKS; i += 1) {
        const place = size.map((width, axis) => {
          // the pattern is fixed to the air, not to the vehicle
          const phase = fraction(this.seeds[3 * i + axis] + this.drift[axis] - at[axis] / width + 0.5);
          return at[axis] + (phase - 0.5) * width;
        });
        place[2] = Math.min(place[2], -0.05);
        line.setXYZ(2 * i, ...place);
        line.setXYZ(2 * i + 1, ...place.map((p, axis) => p - 0.09 * wind[axis]));
      }
      line.needsUpdate = true;
      this.point(wind, at, speed);
    }

    point(wind, at, speed) {
      const along = new THREE.Vector3(wind[0], wind[1], 0).normalize();
      const size = this.arrowSize;
      const length = size * (0.25 + 0.1 * Math.min(speed, 15));
      const start = new THREE.Vector3(at[0], at[1], -0.03);
      const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along);
      this.shaft.quaternion.copy(turn);
      this.tip.quaternion.copy(turn);
      this.shaft.scale.set(size, length, size);
      this.tip.scale.setScalar(size);
      this.shaft.position.copy(start).addScaledVector(along, length / 2);
      this.tip.position.copy(start).addScaledVector(along, length + 0.1 * size);
    }

    dispose() {
      for (const group of this.groups) {
        remove(group);
      }
    }
  }

  function circle([n, e], radius) {
    return Array.from({ length: 72 }, (_, i) => {
      const angle = (2 * Math.PI * i) / 72;
      return [n + radius * Math.cos(angle), e + radius * Math.sin(angle)];
    });
  }

  function fraction(value) {
    return value - Math.floor(value);
  }

  Plumbline.ScenePlaces = Places;
})();
