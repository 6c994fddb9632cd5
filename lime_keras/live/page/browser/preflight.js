// What the page needs of browser and address, said before all else. This is no module: a browser
// loads none from a file, and an old one none at all.
(function () {
  "use strict";

  // A function that returns a vector: `i8x16.popcnt (i8x16.splat (i32.const 0))`.
  var SIMD = [
    0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253,
    15, 253, 98, 11,
  ];
  var RELOADED = "lime-live reloaded";

  function missing() {
    if (location.protocol === "file:") {
      return (
        "This page works from a web server alone. In its folder, run “python3 -m http.server”, " +
        "then open http://localhost:8000/ here."
      );
    }
    if (typeof WebAssembly !== "object" || !WebAssembly.validate(new Uint8Array(SIMD))) {
      return (
        "This browser cannot run the networks: it lacks WebAssembly SIMD. Use Chrome or Edge 91, " +
        "Firefox 114, Safari 16.4, or newer."
      );
    }
    if (!window.isSecureContext) {
      return (
        "Browsers give the camera, and WebAssembly its threads, to pages with HTTPS alone: open " +
        "this page as https://" + location.host + location.pathname + ". Photos work without."
      );
    }
    return "";
  }

  function say(text) {
    var told = document.createElement("p");
    told.setAttribute("role", "alert");
    told.className = "preflight";
    told.style.cssText = "margin:0;padding:0.75em 1em;background:#7a2e0e;color:#fff;font:1em system-ui";
    told.textContent = text;
    document.body.insertBefore(told, document.body.firstChild);
  }

  /** Load the page once more when the service worker can serve it with its headers. */
  function isolate() {
    if (window.crossOriginIsolated || !window.isSecureContext || !navigator.serviceWorker) return;
    navigator.serviceWorker.addEventListener("controllerchange", function () {
      if (sessionStorage.getItem(RELOADED)) return;
      sessionStorage.setItem(RELOADED, "yes");
      location.reload();
    });
    navigator.serviceWorker.register("service_worker.js").catch(function (error) {
      console.info("WebAssembly has one thread: " + error.message);
    });
  }

  var text = missing();
  var runs = location.protocol !== "file:";
  document.addEventListener("DOMContentLoaded", function () {
    if (text) say(text);
    if (!runs) document.getElementById("status").textContent = "Not ready";
  });
  if (runs) isolate();
})();
