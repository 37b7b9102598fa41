// Opens a compressed page: the scene goes where the player looks for it, the code is run, the player starts.
(async () => {
  const text = async (id) => {
    const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).text();
  };
  try {
    const [scene, code] = await Promise.all([text("scene"), text("code")]);
    document.getElementById("scene").textContent = scene;
    const script = document.createElement("script");
    script.textContent = code;
    document.body.appendChild(script);
    startPlayer();
  } catch (error) {
    const message = document.getElementById("message");
    message.style.display = "block";
    message.textContent = "This browser cannot open the compressed page (" + error + "). Save it again with compressed=False.";
  }
})();
