// Mends what the theme leaves out for readers who use a keyboard or a screen reader.
document.addEventListener("DOMContentLoaded", () => {
  // The sidebar with the book's name lies outside every landmark.
  const sidebar = document.getElementById("pst-primary-sidebar");
  sidebar?.setAttribute("role", "navigation");
  sidebar?.setAttribute("aria-label", "Book");
  // docutils gives the entries of the bibliography a role that ARIA has withdrawn.
  for (const entry of document.querySelectorAll('[role="doc-biblioentry"]')) entry.setAttribute("role", "listitem");
});

// What scrolls sideways must be reachable by keyboard. Formulas get their width late, boxes with the window's.
function markScrolling() {
  for (const box of document.querySelectorAll("article :is(div, pre, mjx-container)")) {
    const scrolls = box.scrollWidth > box.clientWidth && /auto|scroll/.test(getComputedStyle(box).overflowX);
    if (scrolls) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
}
window.addEventListener("load", async () => {
  await window.MathJax?.startup?.promise;
  markScrolling();
  window.addEventListener("resize", markScrolling);
});
