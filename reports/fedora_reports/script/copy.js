// Tables for a paper or a spreadsheet: a button holds the text that it copies.

function copy(button) {
  // Not navigator.clipboard, which a page lacks that is served without TLS.
  const fill = event => {
    event.clipboardData.setData("text/plain", button.dataset.copy);
    event.preventDefault();
  };
  document.addEventListener("copy", fill);
  const copied = document.execCommand("copy");
  document.removeEventListener("copy", fill);
  const format = button.firstChild.textContent;
  button.parentElement.querySelector("output").textContent = copied ? `${format} copied` : "This browser does not let a page copy.";
}
