// Paths: the requested one (in one colour) and the flown one, coloured by the error.
"use strict";
(() => {
  const FIRST_CAPACITY = 512;
  const LEAST_FULL = 0.02; // m: smaller errors are not worth a colour

  /** A wide line that can grow; each point has a colour. */
  class Trail {
    constructor(world, width) {
      this.world = world;
      this.count = 0; // of points
      this.last = new Float32Array(6);
      this.material = new THREE.LineMaterial({ vertexColors: true, linewidth: width });
      this.reserve(FIRST_CAPACITY);
    }

    reserve(segments) {
      const before = this.line && this.line.geometry;
      const positions = new Float32Array(6 * segments), colours = new Float32Array(6 * segments);
      if (before) {
        positions.set(this.positions);
        colours.set(this.colours);
      }
      this.positions = positions;
      this.colours = colours;
      const geometry = new THREE.LineSegmentsGeometry();
      geometry.setPositions(positions);
      geometry.setColors(colours);
      this.positionData = geometry.attributes.instanceStart.data;
      this.colourData = geometry.attributes.instanceColorStart.data;
      this.capacity = segments;
      geometry.instanceCount = Math.max(this.count - 1, 0);
      if (this.line) {
        this.line.geometry = geometry;
        before.dispose();
      } else {
        this.line = new THREE.LineSegments2(geometry, this.material);
        this.line.frustumCulled = false;
        this.world.add(this.line);
      }
    }

    clear() {
      this.count = 0;
      this.line.geometry.instanceCount = 0;
    }

    /** Appends the point, in NED, with a colour. */
    add(n, e, d, red, green, blue) {
      const now = [n, e, d, red, green, blue];
      if (this.count > 0) {
        const segment = this.count - 1;
        if (segment >= this.capacity) this.reserve(2 * this.capacity);
        const at = 6 * segment;
        for (let i = 0; i < 3; i += 1) {
          this.positions[at + i] = this.last[i];
          this.positions[at + 3 + i] = now[i];
          this.colours[at + i] = this.last[3 + i];
          this.colours[at + 3 + i] = now[3 + i];
        }
        upload(this.positionData, at);
        upload(this.colourData, at);
      }
      this.last.set(now);
      this.count += 1;
      this.line.geometry.instanceCount = this.count - 1;
    }

    dispose() {
      this.world.remove(this.line);
      this.line.geometry.dispose();
      this.material.dispose();
    }
  }

  function upload(data, at) {
    data.addUpdateRange(at, 6);
    data.needsUpdate = true;
  }

  /** The flown path of one vehicle with the error at each point, and the scale that colours it. */
  class FlownTrack {
    constructor(world, theme) {
      this.trail = new Trail(world, 3.2);
      this.theme = theme;
      this.points = [];
      this.errors = [];
      this.full = LEAST_FULL; // m, the error at the upper end of the scale
      this.only = null; // one colour for the whole path
      this.colour = new Float32Array(3);
    }

    get size() {
      return this.errors.length;
    }

    /** Appends a point; true if the scale had to grow. */
    add(n, e, d, error) {
      this.points.push(n, e, d);
      this.errors.push(error);
      const known = Number.isFinite(error);
      if (known && error > this.full) {
        this.full = Plumbline.sceneTheme.niceAbove(error);
        this.recolour();
        return true;
      }
      this.append(this.errors.length - 1);
      return false;
    }

    append(index) {
      const error = this.errors[index];
      if (this.only !== null) {
        const chosen = new THREE.Color(this.only).convertLinearToSRGB();
        this.colour.set([chosen.r, chosen.g, chosen.b]);
      } else if (Number.isFinite(error)) {
        Plumbline.sceneTheme.scaleColour(this.theme, error / this.full, this.colour, 0);
      } else {
        const grey = this.theme.asked;
        this.colour.set([(grey >> 16) / 255, ((grey >> 8) & 255) / 255, (grey & 255) / 255]);
      }
      const at = 3 * index;
      const [n, e, d] = [this.points[at], this.points[at + 1], this.points[at + 2]];
      this.trail.add(n, e, d, ...toLinear(this.colour));
    }

    recolour() {
      this.trail.clear();
      for (let index = 0; index < this.errors.length; index += 1) this.append(index);
    }

    /** Sets the whole path; `points` is N, E, D, N, ... A colour, if given, is that of all points. */
    set(points, errors, only = null) {
      this.only = only;
      this.points = Array.from(points);
      this.errors = Array.from({ length: points.length / 3 }, (_, i) => (errors ? errors[i] : NaN));
      const most = this.errors.reduce((a, b) => (b > a ? b : a), 0);
      this.full = most > 0 ? Plumbline.sceneTheme.niceAbove(most) : LEAST_FULL;
      this.recolour();
    }

    clear() {
      this.points = [];
      this.errors = [];
      this.full = LEAST_FULL;
      this.trail.clear();
    }

    setTheme(theme) {
      this.theme = theme;
      this.recolour();
    }

    dispose() {
      this.trail.dispose();
    }
  }

  function toLinear(colour) {
    return Array.from(colour, (c) => (c < 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  }

  /** The requested path: one thin line. */
  class AskedTrack {
    constructor(world, theme) {
      this.trail = new Trail(world, 1.6);
      this.points = [];
      this.setTheme(theme);
    }

    add(n, e, d) {
      this.points.push(n, e, d);
      this.trail.add(n, e, d, ...this.rgb);
    }

    set(points) {
      this.clear();
      for (let i = 0; i + 2 < points.length; i += 3) this.add(points[i], points[i + 1], points[i + 2]);
    }

    clear() {
      this.points = [];
      this.trail.clear();
    }

    setTheme(theme) {
      const colour = new THREE.Color(theme.asked);
      this.rgb = [colour.r, colour.g, colour.b];
      const points = this.points;
      this.set(points);
    }

    dispose() {
      this.trail.dispose();
    }
  }

  Plumbline.SceneFlownTrack = FlownTrack;
  Plumbline.SceneAskedTrack = AskedTrack;
})();
