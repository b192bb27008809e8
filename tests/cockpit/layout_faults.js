// Which visible texts and controls leave the page or their box, are covered, or overlap.
() => {
  const faults = [];
  const seen = (element) => element.checkVisibility() && element.getBoundingClientRect().width > 1;
  const name = (element) => `${element.tagName.toLowerCase()}#${element.id || element.className}`;
  const wide = document.documentElement.scrollWidth;
  if (wide > innerWidth) faults.push(`the page is ${wide} wide in a window of ${innerWidth}`);
  const parts = [...document.querySelectorAll(
    "#cockpit-header, #stage, #deck > section, #panels, #tabs, [role=tabpanel], #said, #clock, #view-buttons"
  )].filter(seen);
  const box = (element) => element.getBoundingClientRect();
  parts.forEach((part, i) => {
    const a = box(part);
    if (a.left < -0.5 || a.right > innerWidth + 0.5) faults.push(`${name(part)} leaves the window`);
    for (const other of parts.slice(i + 1)) {
      if (part.contains(other) || other.contains(part)) continue;
      const b = box(other);
      const across = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      // The header stays above what is scrolled.
      if (part.id !== "cockpit-header" && !part.closest("#cockpit-header") && across > 0.5 && down > 0.5) {
        faults.push(`${name(part)} overlaps ${name(other)}`);
      }
    }
    if (part.id === "stage") return;
    for (const child of [...part.querySelectorAll("*")].filter(seen)) {
      if (child.closest("svg") && child.tagName !== "svg") continue;
      if (child.closest(".switch .track, .hidden-text, #touch-stick, thead")) continue;
      const c = box(child);
      if (c.right > a.right + 0.5 || c.bottom > a.bottom + 0.5 || c.left < a.left - 0.5) {
        faults.push(`${name(part)}: ${name(child)} sticks out`);
      }
      const style = getComputedStyle(child);
      const clips = style.overflowX !== "visible" || style.overflowY !== "visible";
      const tooWide = child.scrollWidth > child.clientWidth + 1;
      if (clips && (tooWide || child.scrollHeight > child.clientHeight + 1)) {
        if (!/auto|scroll/.test(style.overflow + style.overflowY)) faults.push(`${name(child)} is cut off`);
      }
    }
  });
  return faults;
}
