/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* A spatial linkage on a canvas: parts between places, before a camera that turns. */

const Space = (() => {
  const PER_PIXEL = 0.01; // rad that the camera turns for a pixel of a drag
  const PER_KEY = Math.PI / 36;
  const [FAINTEST, FADING] = [0.4, 0.6]; // as in `linkage draw`
  const KEYS = {
    ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
  };

  /** Return the corners of the hull of some pixels. */
  function hull(pixels) {
    const found = [];
    let at = pixels.reduce((one, other) => (other[0] < one[0] ? other : one));
    do {
      found.push(at);
      let [next] = pixels;
      for (const each of pixels) {
        const [x, y, a, b] = [next[0] - at[0], next[1] - at[1], each[0] - at[0], each[1] - at[1]];
        if (next === at || x * b < y * a) next = each;
      }
      at = next;
    } while (at !== found[0] && found.length < pixels.length);
    return found;
  }

  /** Return a class of linkages whose places, by their `spot`, are seen from a camera. */
  const seen = (Base) => class extends Base {
    /** Let the camera stand at an azimuth and an elevation. */
    look(azimuth, elevation) {
      this.camera = [azimuth, Math.max(-Math.PI / 2, Math.min(Math.PI / 2, elevation))];
      const [[ca, sa], [ce, se]] = this.camera.map((each) => [Math.cos(each), Math.sin(each)]);
      this.axes = [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
    }

    /** Return where a place is: to the right, upward, and to the camera; null where it is unknown. */
    place(row, number) {
      const spot = this.spot(row, number);
      if (!spot) return null;
      if (!this.axes) this.look(...this.drawn.camera);
      const [x, y, z] = this.drawn.middle.map((middle, i) => spot[i] - middle);
      return this.axes.map((axis) => axis[0] * x + axis[1] * y + axis[2] * z);
    }

    get reach() {
      const [across, up] = this.drawn.reach;
      return [-across, -up, across, up];
    }
  };

  /** Return a class of canvases of such linkages; `turned` is called where the camera has moved. */
  const drawn = (Base) => class extends Base {
    /** Let a drag turn the camera; `isFree` says of a press whether it takes nothing else. */
    listen(turned, isFree = () => true) {
      const { canvas } = this;
      this.turned = turned;
      let held = null;
      canvas.addEventListener('pointerdown', (event) => {
        if (!isFree(event)) return;
        canvas.setPointerCapture(event.pointerId);
        held = event;
      });
      canvas.addEventListener('pointermove', (event) => {
        if (!held || event.pointerId !== held.pointerId) return;
        const [right, down] = [event.clientX - held.clientX, event.clientY - held.clientY];
        this.turn(-right * PER_PIXEL, down * PER_PIXEL);
        held = event;
      });
      for (const end of ['pointerup', 'pointercancel']) {
        canvas.addEventListener(end, () => { held = null; });
      }
      canvas.addEventListener('dblclick', () => {
        this.linkage.look(...this.linkage.drawn.camera);
        this.turn(0, 0);
      });
      canvas.addEventListener('keydown', (event) => {
        if (!KEYS[event.key] || event.altKey || event.ctrlKey || event.metaKey) return;
        this.turn(...KEYS[event.key].map((each) => each * PER_KEY));
        event.preventDefault();
        event.stopPropagation(); // else the run moves on
      });
    }

    /** Turn the camera to the right about the z axis, and upward. */
    turn(right, up) {
      const [azimuth, elevation] = this.linkage.camera;
      this.linkage.look(azimuth + right, elevation + up);
      this.curves = null;
      this.turned();
    }

    draw(number, time, view) {
      const { shapes, extent } = this.linkage.drawn;
      if (this.linkage.hasPose(number, time)) {
        const near = new Map();
        for (const { number: own, corners } of shapes) {
          const each = corners.map((row) => this.linkage.place(row, number)[2]);
          near.set(own, each.reduce((sum, one) => sum + one) / each.length);
        }
        const nearest = Math.max(...near.values());
        for (const shape of shapes) {
          const own = near.get(shape.number);
          shape.strength = Math.max(FAINTEST, 1 - (FADING * (nearest - own)) / extent);
          shape.order = Math.max(own, ...shape.below.map((other) => near.get(other)));
          if (shape.role === 'rail') shape.order = -Infinity;
        }
        shapes.sort((one, other) => one.order - other.order || one.number - other.number);
      }
      return super.draw(number, time, view);
    }

    drawShape(pen, shape, number) {
      const pixels = shape.corners.map((row) => this.toPixel(this.linkage.place(row, number)));
      const wide = 2 * shape.width * this.linkage.drawn.size * this.size.scale;
      const face = this.ink[shape.role];
      pen.beginPath();
      for (const pixel of shape.is_hull ? hull(pixels) : pixels) pen.lineTo(...pixel);
      if (pixels.length === 1) pen.lineTo(pixels[0][0] + 0.01, pixels[0][1]);
      if (shape.is_hull) {
        pen.closePath();
        pen.fillStyle = face;
        pen.fill();
      }
      const isLine = shape.is_hull || !face;
      pen.globalAlpha = shape.strength;
      pen.strokeStyle = shape.role === 'axis' ? this.ink.faint : this.ink.edge;
      pen.lineWidth = isLine ? 1.2 : wide;
      pen.setLineDash(shape.role === 'axis' ? [9, 3, 2, 3] : []);
      pen.stroke();
      pen.setLineDash([]);
      pen.globalAlpha = 1;
      if (isLine) return;
      pen.strokeStyle = face;
      pen.lineWidth = Math.max(1, wide - 2.2);
      pen.stroke();
    }

    /** Draw the directions x, y and z, and the scale where lengths mean something. */
    drawScale(pen) {
      if (this.linkage.drawn.has_lengths) super.drawScale(pen);
      const [x, y] = [this.size.width - 34, this.size.tall - 34];
      pen.font = `11px ${getComputedStyle(document.body).fontFamily}`;
      pen.strokeStyle = pen.fillStyle = this.ink.faint;
      pen.lineWidth = 1;
      pen.textAlign = 'center';
      for (const [i, name] of ['x', 'y', 'z'].entries()) {
        const [right, up] = this.linkage.axes.map((axis) => axis[i]);
        pen.beginPath();
        pen.moveTo(x, y);
        pen.lineTo(x + 20 * right, y - 20 * up);
        pen.stroke();
        pen.fillText(name, x + 28 * right, y - 28 * up + 4);
      }
      pen.textAlign = 'start';
    }
  };

  class Linkage extends seen(Picture.Linkage) {
    spot(row, number) {
      const at = 3 * (number * this.drawn.count + row);
      if (number < 0 || !Number.isFinite(this.poses[at])) return null;
      return this.poses.subarray(at, at + 3);
    }

    hasPose(number, time) {
      return !this.isSilent(time) && this.spot(0, number) !== null;
    }
  }

  class Canvas extends drawn(Picture.Canvas) {
    constructor(canvas, linkage, show) {
      super(canvas, linkage);
      this.listen(show);
    }
  }

  return { Linkage, Canvas, seen, drawn };
})();
