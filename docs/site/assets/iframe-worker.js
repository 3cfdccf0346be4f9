// Search without a server: a page opened as a file may start no worker, so its script runs in a hidden frame.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      const script = new URL(url, document.baseURI).href.replaceAll("&", "&amp;").replaceAll('"', "&quot;")
      this.waiting = []
      this.frame = document.createElement("iframe")
      this.frame.hidden = true
      this.frame.srcdoc = `<script src="${script}"></scr` + "ipt>"
      this.frame.addEventListener("load", () => {
        this.frame.contentWindow.postMessage = data => this.say(this, data)
        this.waiting.forEach(data => this.say(this.frame.contentWindow, data))
        this.waiting = null
      })
      document.body.append(this.frame)
    }

    say(target, data) {
      setTimeout(() => target.dispatchEvent(new MessageEvent("message", { data })))
    }

    postMessage(data) {
      if (this.waiting) this.waiting.push(data)
      else this.say(this.frame.contentWindow, data)
    }

    terminate() {
      this.frame.remove()
    }
  }
}
