/* Copyright 2026 The linkage_ros authors. Licensed under the Apache License, Version 2.0. */
/* The plots of a run; those over time share their range, and a line at the time of the picture. */

const Plots = (() => {
  const STILL = 4; // pixels: a pointer that moves farther has dragged
  const { curves, events } = OverTime;
  const { crossed, spread } = OverOthers;
  const makers = [[/^events$/, events], [/^crossed_/, crossed], [/^spread_/, spread], [/./, curves]];

  class Plot {
    constructor(figure) {
      this.figure = figure;
      this.place = figure.querySelector('.plot');
      const key = figure.dataset.plot;
      this.plot = Page.data.plots.find((each) => each.key === key) ?? { key };
      this.maker = makers.find(([pattern]) => pattern.test(key))[1];
      this.overTime = this.maker === curves || this.maker === events;
    }

    draw(view) {
      const width = Math.floor(this.place.clientWidth);
      if (!width) return;
      const ink = Page.colours();
      const [traces, own] = this.maker(this.plot, width, ink, view);
      if (this.plot.unit) {
        const { unit } = Angles.shown(this.plot.unit);
        this.figure.querySelector('figcaption').textContent = `${this.plot.title} [${unit}]`;
      }
      const layout = Page.layout(width, ink, { uirevision: 'kept', ...own });
      this.view = view;
      // What Plotly does to the axis comes back as an event, and is none of the reader's.
      this.drawing = true;
      Plotly.react(this.place, traces, layout, Page.config);
      this.drawing = false;
      this.width = width;
      this.edges = layout.margin;
      this.height = layout.height;
      if (!this.overTime) return;
      if (!this.cursor) this.begin();
      this.move(Report.time);
    }

    begin() {
      this.cursor = document.createElement('div');
      this.cursor.className = 'cursor';
      this.place.append(this.cursor);
      this.place.on('plotly_relayout', (change) => {
        if (this.drawing) return;
        if (change['xaxis.autorange']) Report.zoom(null);
        else if (change['xaxis.range[0]'] !== undefined) {
          Report.zoom([change['xaxis.range[0]'], change['xaxis.range[1]']]);
        } else if (change['xaxis.range']) Report.zoom(change['xaxis.range']);
      });
      this.place.on('plotly_doubleclick', () => Report.zoom(null));
      this.place.addEventListener('pointerdown', (down) => this.press(down));
      // Behind the other: where the pointer is at a point, its time is what is meant.
      this.place.on('plotly_click', (click) => Report.seek(click.points[0].x));
    }

    /** Go to the time at which the plot is clicked. */
    press(down) {
      if (down.button || !down.target.classList.contains('nsewdrag')) return;
      addEventListener('pointerup', (up) => {
        const moved = Math.hypot(up.clientX - down.clientX, up.clientY - down.clientY);
        if (up.pointerId !== down.pointerId || moved > STILL) return;
        const { l, r } = this.edges;
        const x = down.clientX - this.place.getBoundingClientRect().left - l;
        const [from, to] = this.view;
        Report.seek(from + (x / (this.width - l - r)) * (to - from));
      }, { once: true });
    }

    /** Put the line at the time that the picture shows. */
    move(time) {
      if (!this.cursor) return;
      const [from, to] = this.view;
      const share = (time - from) / (to - from);
      const { l, r, t, b } = this.edges;
      this.cursor.hidden = share < 0 || share > 1;
      this.cursor.style.height = `${this.height - t - b}px`;
      this.cursor.style.top = `${t}px`;
      this.cursor.style.transform = `translateX(${l + share * (this.width - l - r)}px)`;
    }
  }

  return { Plot };
})();
