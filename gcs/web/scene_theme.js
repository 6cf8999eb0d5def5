// Colours of the scene and the scale of errors. Blue, amber and vermilion differ for colour-blind people too.
"use strict";
var Plumbline = globalThis.Plumbline || {};
globalThis.Plumbline = Plumbline;

(() => {
  const THEMES = {
    dark: {
      background: 0x0e141b, ground: 0x121a23, gridMinor: 0x1e2a36, gridMajor: 0x33475a, label: "#8fa3b5",
      hull: 0xdfe7ee, nose: 0xff8a4c, arm: 0x8b9bab, rotor: 0x9fc7ea, rotorFull: 0xff8a4c, motor: 0x55657a,
      cable: 0xf2f6fa, slack: 0xffb454, load: 0xf5c04a, loadFree: 0xff8a4c, asked: 0x8fa3b5, target: 0xffffff,
      shadow: 0x000000, wind: 0x6ec6ff, inclusion: 0x43b5a0, exclusion: 0xff6b5b, rally: 0xb79cff,
      goal: 0xffffff, scale: [0x3d9bff, 0xffd166, 0xff4d2e], keyLight: 2.4, fillLight: 1.5,
    },
    light: {
      background: 0xf4f6f8, ground: 0xffffff, gridMinor: 0xe3e8ed, gridMajor: 0xc3cdd6, label: "#5a6b7b",
      hull: 0x2c3a48, nose: 0xd9541e, arm: 0x516273, rotor: 0x3a7ab5, rotorFull: 0xd9541e, motor: 0x2c3a48,
      cable: 0x22303d, slack: 0xb86e00, load: 0xd99a00, loadFree: 0xd9541e, asked: 0x7b8b9a, target: 0x22303d,
      shadow: 0x2c3a48, wind: 0x1769aa, inclusion: 0x11806a, exclusion: 0xc8321e, rally: 0x6b46c1,
      goal: 0x22303d, scale: [0x1464b4, 0xd9a400, 0xc8321e], keyLight: 2.6, fillLight: 2.0,
    },
  };

  /** The colours of `name`: "dark", "light", or "auto" as the user's system prefers. */
  function themeOf(name) {
    if (name === "dark" || name === "light") return THEMES[name];
    return THEMES[matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark"];
  }

  /** Writes red, green and blue of the scale at `share` (0 ... 1) into `out` from index `at`. */
  function scaleColour(theme, share, out, at) {
    const place = Math.min(Math.max(share, 0), 1) * (theme.scale.length - 1);
    const lower = Math.min(Math.floor(place), theme.scale.length - 2);
    const part = place - lower;
    const a = theme.scale[lower], b = theme.scale[lower + 1];
    for (let channel = 0; channel < 3; channel += 1) {
      const shift = 16 - 8 * channel;
      const value = ((a >> shift) & 255) * (1 - part) + ((b >> shift) & 255) * part;
      out[at + channel] = value / 255;
    }
  }

  /** The least of 1, 2, 5 times a power of ten that is >= value. */
  function niceAbove(value) {
    const power = 10 ** Math.floor(Math.log10(Math.max(value, 1e-6)));
    return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.999);
  }

  Plumbline.sceneTheme = { themeOf, scaleColour, niceAbove };
})();
