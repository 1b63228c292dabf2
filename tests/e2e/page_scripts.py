"""What is told a page before it runs: to be another browser, or to be looked into."""

LENS = "canvas camera"
BE_CAMERA = f"""navigator.mediaDevices.getUserMedia = async () => {{
    const stream = canvas.captureStream(30);
    Object.defineProperty(stream.getVideoTracks()[0], 'label', {{value: '{LENS}'}});
    window.filming = stream;
    return stream;
  }};"""
"""What is painted on `canvas` is what the page's camera sees."""
STAMPED_CAMERA = f"""{BE_CAMERA}
  let stamp = () => {{}};
  if (window.MediaStreamTrackGenerator) {{
    navigator.mediaDevices.getUserMedia = async () => {{
      const track = new MediaStreamTrackGenerator({{kind: 'video'}});
      const writer = track.writable.getWriter();
      Object.defineProperty(track, 'label', {{value: '{LENS}'}});
      stamp = (ms) => {{
        if (track.readyState === 'ended') return;
        writer.write(new VideoFrame(canvas, {{timestamp: Math.round(1e3 * ms)}}));
      }};
      window.filming = new MediaStream([track]);
      return filming;
    }};
  }}"""
"""The same camera films `canvas` when `stamp` is called, and stamps the picture with the time that
it is given [ms] where the browser permits it, as a camera's hardware does: the browser stamps a
canvas when it comes to read it, on a busy machine up to 36 ms late."""
PAINTED_CAMERA = f"""{STAMPED_CAMERA}
  let painted = -Infinity;
  const onFrame = () => {{
    requestAnimationFrame(onFrame);
    const ms = performance.now();
    if (ms - painted < 25) return;  // 30 Hz, of a screen's 60
    painted = ms;
    paintAt(ms);
    stamp(ms);
  }};
  onFrame();"""
"""That camera films what `paintAt` paints on `canvas` for a time [ms]."""
FELT = """
(() => {
  const told = [];
  window.tellFelt = (rows) => {
    told.push(...rows);
    told.splice(0, told.length - 100);
  };
  window.feltAt = (ms) => {
    const next = told.findIndex(([t]) => t >= ms);
    if (next < 1) return undefined;
    const [[t, ...before], [later, ...after]] = [told[next - 1], told[next]];
    const share = (ms - t) / (later - t);
    return before.map((value, k) => value + share * (after[k] - value));
  };
})();
"""
"""What sensors feel at a time of the page's clock, from what was told of the future; undefined
where nothing was. A row is a time [ms], then x, y, z of each of `SENSORS`."""
STAMP_SENSORS = """
(() => {
  const stamped = (Sensor, first, unit) => class extends Sensor {
    felt(axis, given) {
      const felt = feltAt(this.timestamp);
      return felt ? unit * Math.round(felt[first + axis] / unit) : given;
    }
    get x() { return this.felt(0, super.x); }
    get y() { return this.felt(1, super.y); }
    get z() { return this.felt(2, super.z); }
  };
  window.Accelerometer = stamped(Accelerometer, 0, 0.1);
  window.Gyroscope = stamped(Gyroscope, 3, 0.1 * Math.PI / 180);
})();
"""
"""Chromium's sensors read what is felt at their stamps, as hardware does, rounded as it rounds:
what it is fed it stamps when it hears of it, on a busy machine 10 to 25 ms late."""
NO_WEBRTC = "delete window.RTCPeerConnection;"
STREAMS_ONLY = "delete window.RTCRtpScriptTransform;"
NO_ENCODER = "delete window.VideoEncoder;"
LACKING = {"WebRTC": (), "WebCodecs": (NO_WEBRTC,), "JPEG": (NO_WEBRTC, NO_ENCODER)}
"""What a page lacks whose pictures can't come by a better path than this."""
KEEP_CONNECTIONS = """
window.made = [];
window.RTCPeerConnection = class extends RTCPeerConnection {
  constructor(configuration) { super(configuration); made.push(this); }
};
"""
NO_H264 = r"""
window.RTCPeerConnection = class extends RTCPeerConnection {
  setRemoteDescription({type, sdp}) {
    const lines = sdp.split('\r\n');
    const found = (pattern) => lines.map((line) => line.match(pattern)).filter(Boolean);
    const h264 = found(/^a=rtpmap:(\d+) H264/).map(([, n]) => n);
    const again = found(/^a=fmtp:(\d+) apt=(\d+)/).filter(([, , n]) => h264.includes(n));
    const gone = [...h264, ...again.map(([, n]) => n)];
    const kept = lines.filter((line) => !gone.some((n) => RegExp(`^a=[a-z-]+:${n} `).test(line)));
    const less = (line) => line.split(' ').filter((word) => !gone.includes(word)).join(' ');
    const said = kept.map((line) => (line.startsWith('m=video') ? less(line) : line));
    return super.setRemoteDescription({type, sdp: said.join('\r\n')});
  }
};
"""
TICKER = """
window.pageHoles = [];
(() => {
  let before = performance.now();
  setInterval(() => {
    const now = performance.now();
    if (now - before > 50) pageHoles.push([now, now - before]);
    before = now;
  }, 5);
})();
"""
"""Notes when the page's main thread was away, and for how long [ms]."""
COUNT_GIVEN = """
(() => {
  const came = {phone_imu: [], video: []};
  const note = (name) => came[name].push(performance.now());
  const gyroscope = new Gyroscope({frequency: 60});
  gyroscope.onreading = () => note('phone_imu');
  gyroscope.start();
  const {readable} = new MediaStreamTrackProcessor({track: filming.getVideoTracks()[0].clone()});
  readable.pipeTo(new WritableStream({write(frame) { note('video'); frame.close(); }}));
  window.givenHz = (windowS) => {
    const since = performance.now() - 1000 * windowS;
    const rate = (times) => times.filter((t) => t >= since).length / windowS;
    return Object.fromEntries(Object.entries(came).map(([name, times]) => [name, rate(times)]));
  };
})();
"""
"""Counts what a page that films was given to send on: a slow machine's browser gives less."""
