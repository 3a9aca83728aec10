/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/*
 * The linkage on a canvas: the shapes of `linkage draw`, moved with the links that carry them.
 *
 * `Linkage` has recorded poses. A canvas needs of it only `drawn`, `times`, `reach`, `place` and
 * `hasPose`, so a page that computes its poses draws them here, too.
 */

const Picture = (() => {
  const TRAIL = 1.0; // s: how long a traced point leaves a strong line behind
  const MOST = 4000; // places of a traced curve
  const LEAP = 0.06; // of the picture: between places farther apart nothing is known
  const LOOKED_AT = 400; // pictures of a run, to see how far its links reach
  const WIDER = 0.5; // of what the linkage takes by itself: so much is added on each side at most
  const [LEAST_HEIGHT, MOST_HEIGHT, FOOT] = [160, 460, 30];

  class Linkage {
    constructor(said, frames) {
      Object.assign(this, said);
      this.times = frames.times;
      this.poses = Curves.unpacked(said.poses, Float32Array);
      this.apart = Curves.unpacked(said.apart, Float32Array);
      this.places = new Map(said.links.map((link, i) => [link, i]));
    }

    /** Return where the frame of a link is in a picture, and its angle; null where none is. */
    frame(link, number) {
      if (link === 'ground') return [0, 0, 0];
      const width = this.links.length;
      const at = 3 * (number * width + this.places.get(link));
      const frame = this.poses.subarray(at, at + 3);
      return number >= 0 && Number.isFinite(frame[0]) ? frame : null;
    }

    /** Return where a place of a link is in a picture. */
    place(link, x, y, number) {
      const frame = this.frame(link, number);
      if (!frame) return null;
      const [cos, sin] = [Math.cos(frame[2]), Math.sin(frame[2])];
      return [frame[0] + cos * x - sin * y, frame[1] + sin * x + cos * y];
    }

    isSilent(time) {
      const at = Curves.above(this.silentBegins, time) - 1;
      return at >= 0 && time < this.silent[at][1] && time > this.silent[at][0];
    }

    get silentBegins() {
      this.begins ??= this.silent.map((span) => span[0]);
      return this.begins;
    }

    /** Return lower left and upper right of all that the links come to, as they were recorded. */
    get reach() {
      if (this.reached) return this.reached;
      const { frame, shapes, paths, size } = this.drawn;
      const found = [Infinity, Infinity, -Infinity, -Infinity];
      const take = ([x, y]) => {
        [found[0], found[1]] = [Math.min(found[0], x), Math.min(found[1], y)];
        [found[2], found[3]] = [Math.max(found[2], x), Math.max(found[3], y)];
      };
      const step = Math.max(1, Math.floor(this.times.length / LOOKED_AT));
      for (const { link, points } of shapes) {
        const last = link === 'ground' ? 1 : this.times.length;
        for (let number = 0; number < last; number += step) {
          if (!this.frame(link, number)) continue;
          for (let i = 0; i < points.length; i += 2) {
            take(this.place(link, points[i], points[i + 1], number));
          }
        }
      }
      for (const path of Object.values(paths)) {
        for (let k = 0; k < path.length; k += 2) take([path[k], path[k + 1]]);
      }
      const [left, bottom, right, top] = frame;
      const [across, up] = [WIDER * (right - left), WIDER * (top - bottom)];
      // A single wild value must not make all else small.
      this.reached = [
        Math.max(found[0] - 2 * size, left - across), Math.max(found[1] - 2 * size, bottom - up),
        Math.min(found[2] + 2 * size, right + across), Math.min(found[3] + 2 * size, top + up),
      ];
      if (!this.times.length) this.reached = frame;
      return this.reached;
    }

    /** Return whether the links have a pose in a picture, at a time. */
    hasPose(number, time) {
      if (number < 0 || this.isSilent(time)) return false;
      return this.links.every((link) => this.frame(link, number));
    }
  }

  const lineWidths = { rail: 1.6, hatch: 0.9, slot: 2.6 };

  class Canvas {
    constructor(canvas, linkage) {
      this.canvas = canvas;
      this.linkage = linkage;
      this.traces = true;
      this.tallest = MOST_HEIGHT;
      this.absent = 'no pose was recorded here';
    }

    /** Fit the canvas to its width; `ink` has the colours of the page. */
    fit(ink) {
      this.ink = ink;
      const [left, bottom, right, top] = this.linkage.reach;
      const width = Math.max(80, Math.floor(this.canvas.parentElement.clientWidth));
      const wanted = (width * (top - bottom)) / (right - left) + FOOT;
      const tall = Math.min(Math.max(wanted, LEAST_HEIGHT), this.tallest);
      const scale = Math.min(width / (right - left), (tall - FOOT) / (top - bottom));
      const ratio = window.devicePixelRatio || 1;
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(tall * ratio);
      this.canvas.style.height = `${tall}px`;
      this.size = { width, tall, ratio, scale };
      const x = width / 2 - (scale * (left + right)) / 2;
      const y = (tall - FOOT) / 2 + (scale * (top + bottom)) / 2;
      this.toPixel = (place) => [x + scale * place[0], y - scale * place[1]];
      this.toPlace = (pixel) => [(pixel[0] - x) / scale, (y - pixel[1]) / scale];
      this.curves = null;
    }

    draw(number, time, view) {
      const { ratio, width, tall } = this.size;
      const pen = this.canvas.getContext('2d');
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, tall);
      pen.lineJoin = pen.lineCap = 'round';
      const there = this.linkage.hasPose(number, time);
      if (this.traces) this.drawCurves(pen, number, time, view);
      for (const shape of this.linkage.drawn.shapes) {
        if (shape.link !== 'ground' && !there) continue;
        this.drawShape(pen, shape, number);
      }
      if (there && this.traces) this.drawTraced(pen, number);
      if (!there) this.say(pen, this.absent);
      this.drawScale(pen);
      return there;
    }

    drawShape(pen, shape, number) {
      const { points } = shape;
      pen.beginPath();
      if (shape.radius) {
        const place = this.linkage.place(shape.link, points[0], points[1], number);
        pen.arc(...this.toPixel(place), shape.radius * this.size.scale, 0, 2 * Math.PI);
      } else {
        for (let i = 0; i < points.length; i += 2) {
          const place = this.linkage.place(shape.link, points[i], points[i + 1], number);
          pen.lineTo(...this.toPixel(place));
        }
        if (shape.closed) pen.closePath();
      }
      if (shape.closed || shape.radius) {
        pen.fillStyle = this.ink[shape.role];
        pen.fill();
        pen.lineWidth = 1.1;
        pen.strokeStyle = this.ink.edge;
      } else {
        pen.lineWidth = lineWidths[shape.role];
        pen.strokeStyle = shape.role === 'slot' ? this.ink.slot : this.ink.edge;
      }
      pen.stroke();
    }

    /** Draw what traced points go through over the range, in the zoom, and within the trail. */
    drawCurves(pen, number, time, view) {
      const { traced, paths } = this.linkage.drawn;
      const key = view.join();
      if (!this.curves || this.curvesOf !== key) {
        this.curves = traced.map((each) => this.curve(each, ...view, MOST));
        this.curvesOf = key;
      }
      traced.forEach((each, i) => {
        const path = paths[each.point];
        pen.strokeStyle = Looks.colour(i, this.ink.edge);
        if (path) {
          pen.beginPath();
          for (let k = 0; k < path.length; k += 2) {
            pen.lineTo(...this.toPixel([path[k], path[k + 1]]));
          }
          pen.setLineDash([6, 4]);
          pen.lineWidth = 1;
          pen.globalAlpha = 0.7;
          pen.stroke();
          pen.setLineDash([]);
        }
        pen.globalAlpha = 0.35;
        pen.lineWidth = 2.5;
        pen.stroke(this.curves[i]);
        pen.globalAlpha = 1;
        pen.lineWidth = 2.5;
        pen.stroke(this.curve(each, time - TRAIL, time, MOST));
      });
    }

    /** Return the places of a traced point as a path; between far ones there is no line. */
    curve(traced, from, to, most) {
      const { times } = this.linkage;
      const path = new Path2D();
      const first = Curves.above(times, from - 1e-9);
      const last = Curves.above(times, to);
      const step = Math.max(1, Math.ceil((last - first) / most));
      const leap = LEAP * Math.hypot(this.size.width, this.size.tall);
      let before = null;
      for (let i = first; i < last; i += step) {
        const place = this.linkage.place(traced.link, ...traced.at, i);
        if (!place) {
          before = null;
          continue;
        }
        const [x, y] = this.toPixel(place);
        if (before && Math.hypot(x - before[0], y - before[1]) < leap) path.lineTo(x, y);
        else {
          path.moveTo(x, y);
          path.lineTo(x + 0.01, y);
        }
        before = [x, y];
      }
      return path;
    }

    drawTraced(pen, number) {
      this.linkage.drawn.traced.forEach((each, i) => {
        const place = this.linkage.place(each.link, ...each.at, number);
        pen.beginPath();
        pen.arc(...this.toPixel(place), 4, 0, 2 * Math.PI);
        pen.fillStyle = Looks.colour(i, this.ink.edge);
        pen.fill();
      });
    }

    say(pen, text) {
      pen.font = `15px ${getComputedStyle(document.body).fontFamily}`;
      pen.textAlign = 'right';
      pen.fillStyle = this.ink.faint;
      pen.fillText(text, this.size.width - 12, 22);
      pen.textAlign = 'start';
    }

    drawScale(pen) {
      const { scale, tall } = this.size;
      // In the unit of the file; if that is the metre, in millimetres where less than one.
      let { length: unit, factor } = Angles.chosen.length;
      if (unit === 'm' && scale > 120) [unit, factor] = ['mm', 1e-3];
      const power = 10 ** Math.floor(Math.log10(120 / (scale * factor)));
      const count = [5, 2, 1].map((k) => k * power).find((each) => each * scale * factor <= 120);
      const [x, y] = [12.5, tall - 8.5];
      const end = x + count * scale * factor;
      pen.beginPath();
      for (const [px, py] of [[x, y - 4], [x, y], [end, y], [end, y - 4]]) pen.lineTo(px, py);
      pen.lineWidth = 1;
      pen.strokeStyle = pen.fillStyle = this.ink.faint;
      pen.stroke();
      pen.font = `11px ${getComputedStyle(document.body).fontFamily}`;
      pen.fillText(`${Number(count.toPrecision(3))} ${unit}`, end + 6, y + 2);
    }
  }

  /** Return the colours of a drawing by the roles of its shapes, on light or dark paper. */
  function ink() {
    const roles = [...Object.keys(Page.data.faces), 'slot', 'pin'];
    const own = Page.colours(...roles.map((role) => `dark-${role}`));
    const found = { slot: '#ffffff', pin: '#ffffff', ...Page.data.faces, faint: own.faint };
    if (!Page.isDark()) return found;
    for (const role of roles) found[role] = own[`dark-${role}`] || found[role];
    return found;
  }

  return { Linkage, Canvas, ink };
})();
