// A figure that is shown much smaller than it was drawn can be enlarged: by a tap on it, or by the button that follows it.
const REDUCED = 0.8; // of its own width
document.addEventListener("DOMContentLoaded", () => {
  const figures = [...document.querySelectorAll("article figure img, article .picture-still img")];
  const pictures = figures.filter((each) => !each.closest("a"));
  for (const picture of pictures) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "enlarge";
    button.textContent = "Enlarge the figure";
    picture.after(button);
    picture.addEventListener("click", () => button.checkVisibility() && show(picture, button));
    button.addEventListener("click", () => show(picture, button));
  }
  const isReduced = ({ clientWidth, naturalWidth }) => clientWidth > 0 && clientWidth < REDUCED * naturalWidth;
  const judge = () => pictures.forEach((each) => each.classList.toggle("reduced", isReduced(each)));
  for (const each of pictures) each.addEventListener("load", judge);
  new ResizeObserver(judge).observe(document.querySelector("article") ?? document.body);

  // The focus goes back to the button, wherever the reader tapped.
  function show(picture, button) {
    const dialog = document.createElement("dialog");
    dialog.className = "enlarged";
    dialog.setAttribute("aria-label", "Enlarged figure");
    const close = document.createElement("button");
    close.type = "button";
    close.textContent = "Close";
    close.addEventListener("click", () => dialog.close());
    const large = document.createElement("figure");
    large.tabIndex = 0;
    large.setAttribute("role", "group");
    large.setAttribute("aria-label", "Figure, which scrolls");
    const image = picture.cloneNode();
    image.classList.remove("reduced");
    image.removeAttribute("style");
    large.append(image);
    dialog.append(close, large);
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close());
    // The theme keeps this key from the browser, which would close the dialog.
    dialog.addEventListener("keydown", (event) => event.key === "Escape" && dialog.close());
    dialog.addEventListener("close", () => {
      dialog.remove();
      button.focus();
    });
    document.querySelector(".bd-content").append(dialog);
    dialog.showModal();
    close.focus();
  }
});
