export default {
  template: `
    <div>
      <img ref="picture" draggable="false" @mousemove="point" @mousedown="point" @mouseleave="leave" />
      <svg :viewBox="'0 0 ' + width + ' ' + height" preserveAspectRatio="none">
        <g ref="lines"></g>
        <g v-if="over" class="t-cross">
          <line :x1="x" :x2="x" y1="0" :y2="height" />
          <line x1="0" :x2="width" :y1="y" :y2="y" />
        </g>
      </svg>
    </div>
  `,
  data: () => ({ width: 1, height: 1, x: 0, y: 0, over: false }),
  methods: {
    // Done when the picture is there; one that is overtaken is done when its successor is.
    show(uri, width, height, lines) {
      const picture = this.$refs.picture;
      [this.width, this.height] = [width, height];
      this.$refs.lines.innerHTML = lines;
      if (picture.src === uri) return;
      const done = new Promise((resolve) => {
        picture.onload = picture.onerror = resolve;
      });
      picture.src = uri;
      return done;
    },
    point(event) {
      const picture = this.$refs.picture;
      this.x = (event.offsetX * this.width) / picture.clientWidth;
      this.y = (event.offsetY * this.height) / picture.clientHeight;
      this.over = true;
      const pressed = event.type === "mousedown" || (event.buttons & 1) === 1;
      this.$emit("mouse", { x: this.x, y: this.y, pressed });
    },
    leave() {
      this.over = false;
    },
  },
};
