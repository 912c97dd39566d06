import js from "@eslint/js";

const browser = [
  "Blob", "CustomEvent", "Event", "EventSource", "HTMLElement", "HTMLInputElement", "HTMLSelectElement", "ResizeObserver",
  "URL", "URLSearchParams", "atob", "addEventListener", "clearInterval", "clearTimeout", "console", "devicePixelRatio", "document", "fetch", "history", "location", "matchMedia", "navigator", "performance",
  "requestAnimationFrame", "setInterval", "setTimeout", "window",
];

export default [
  js.configs.recommended,
  {
    files: ["src/armkin/teach/static/js/*.js", "src/armkin/teach/local/*.js"],
    languageOptions: { globals: Object.fromEntries(browser.map((name) => [name, "readonly"])) },
    rules: {
      eqeqeq: "error",
      "no-implicit-globals": "error",
      "no-var": "error",
      "prefer-const": "error",
      "max-lines": ["error", 300],
      "no-restricted-properties": ["error", { property: "innerHTML", message: "text is text: use textContent" }],
    },
  },
];
