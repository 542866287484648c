/** What all pages have in common. */

/** The element with this id. */
export function byId(id) {
  return document.getElementById(id);
}

/** The time, s, of a clock that never goes back. */
export function seconds() {
  return performance.now() / 1000;
}

/** Give a select element these options; the one chosen before stays chosen, or `chosen` is. */
export function setOptions(select, names, chosen) {
  const before = select.value || chosen;
  select.replaceChildren(...names.map((name) => new Option(name.replaceAll("_", " "), name)));
  if (names.includes(before)) {
    select.value = before;
  }
}

/** Show the value of a slider as a text, to those who listen too. */
export function showValue(name, text) {
  byId(`${name}-shown`).textContent = text;
  byId(name).setAttribute("aria-valuetext", text);
}

/** A name as the first word of a sentence. */
export function capital(name) {
  return name.charAt(0).toUpperCase() + name.slice(1);
}

/** Offer bytes as a file to keep. */
export function download(bytes, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([bytes], { type: "application/octet-stream" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

/** Call `draw` with the time, s, before every picture of the screen. */
export function everyPicture(draw) {
  const next = (time) => {
    requestAnimationFrame(next);
    draw(time / 1000);
  };
  requestAnimationFrame(next);
}
