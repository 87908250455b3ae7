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

// A colour of the style sheet, for what is drawn; asked for once, as each answer has the page's style computed anew.
const styled = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => styled.clear());
export function colourOf(name) {
  const value = styled.get(name) || getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  styled.set(name, value); // empty in a frame that is not displayed, and asked for again
  return value;
}

const ARMS = 6;
export const armName = (arm) => `arm-${arm % ARMS}`; // of a colour, and of a class with that colour
