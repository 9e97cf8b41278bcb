// Unpack what the page is made of, and begin.
(async () => {
  const say = (line) => { const place = document.getElementById("notice"); place.hidden = false; place.textContent = line; };
  if (!("DecompressionStream" in self && "WebAssembly" in self)) { say("This browser is too old for the bench: it needs WebAssembly and DecompressionStream."); return; }
  const unpacked = async (id) => {
    const plain = atob(document.getElementById(id).textContent);
    const bytes = new Uint8Array(plain.length);
    for (let k = 0; k < plain.length; k += 1) bytes[k] = plain.charCodeAt(k);
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  };
  try {
    const [text, code] = await Promise.all(["text", "code"].map(unpacked));
    const { modules, css, world } = JSON.parse(new TextDecoder().decode(text));
    const style = document.createElement("style");
    style.textContent = css;
    document.head.append(style);
    globalThis.servotwin = { world, module: await WebAssembly.compile(code) };
    const imports = {};
    for (const [name, own] of Object.entries(modules)) imports[name] = `data:text/javascript;charset=utf-8,${encodeURIComponent(own)}`;
    const map = document.createElement("script");
    map.type = "importmap";
    map.textContent = JSON.stringify({ imports });
    document.head.append(map);
    await import("bench/main.js");
  } catch (error) {
    say(`The bench cannot begin: ${error.message}`);
    throw error;
  }
})();
