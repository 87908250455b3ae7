// How numbers are written, and how elements are made.

export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "class") element.className = value;
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child !== null));
  return element;
}

export const signed = (seconds) => `${seconds < -0.05 ? "−" : "+"}${Math.abs(seconds).toFixed(1)} s`;

export function percent(share, atMost = false) {
  if (share === null) return "–";
  const shown = 100 * share;
  if (shown < 0.1) return "<0.1 %";
  return `${atMost ? "<" : ""}${shown < 9.5 ? shown.toFixed(1) : shown.toFixed(0)} %`;
}

export const timeOf = (seconds) => `${seconds.toFixed(1)} s`;

// Where a value goes that was drawn with a colour of the style sheet.
export function colours() {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
}

export const armClass = (arm) => `arm-${arm % ARMS}`;
export const armColour = (arm) => `arm-${arm % ARMS}`;
export const ARMS = 6;
