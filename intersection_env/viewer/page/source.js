// Where answers come from: the command that serves this page, or the page itself where it was exported.

export function openSource() {
  const shown = document.getElementById("shown");
  return shown ? fileSource(JSON.parse(shown.textContent)) : liveSource();
}

function liveSource() {
  const ask = async (kind, request = {}) => {
    let response;
    try {
      response = await fetch(kind, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify(request),
      });
    } catch {
      throw new Error("the command that served this page has ended");
    }
    const answer = await response.json();
    if (!response.ok) throw new Error(answer.error);
    return answer;
  };
  return { editable: true, moments: null, ask };
}

function fileSource(data) {
  const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
  const answers = {
    opened: () => data.opened,
    road: () => data.road,
    scene: () => data.scene,
    ranked: ({ step }) => moment(step)?.ranked ?? null,
    predicted: ({ step, priorities }) => {
      const at = moment(step);
      if (!at || !priorities) return at?.predicted ?? null;
      return at.orders[at.ranked.rows.findIndex((row) => same(row.priorities, priorities))];
    },
  };
  const moment = (step = 0) => data.moments.find((one) => one.step === step);
  const steps = data.moments.map((one) => one.step);
  return { editable: false, moments: steps, ask: async (kind, request) => answers[kind](request) };
}
