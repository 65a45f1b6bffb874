//! A browser without a window, driven by the protocol `WebDriver`.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use base64::prelude::{BASE64_STANDARD, Engine as _};
use serde_json::{Value, json};

/// How long a machine that stalls may take for one command.
const PATIENCE: Duration = Duration::from_secs(120);

/// Chromium with one open page; both end with the test.
pub(super) struct Browser {
    driver: Child,
    agent: ureq::Agent,
    session: String,
}

impl Browser {
    pub(super) fn start() -> Browser {
        let mut driver = Command::new("chromedriver")
            .arg("--port=0")
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("chromedriver runs");
        let port = port(driver.stdout.take().expect("piped"));
        let config = ureq::Agent::config_builder()
            .timeout_global(Some(PATIENCE))
            .http_status_as_error(false)
            .build();
        let mut browser = Browser {
            driver,
            agent: config.into(),
            session: format!("http://127.0.0.1:{port}/session"),
        };
        // The tests may run as root, who gets no sandbox.
        let arguments = ["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"];
        let options = json!({ "args": arguments });
        let wanted =
            json!({ "goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"} });
        let session = browser.post("", &json!({ "capabilities": { "alwaysMatch": wanted } }));
        let id = session["sessionId"].as_str().expect("a session").to_owned();
        browser.session = format!("{}/{id}", browser.session);
        browser
    }

    pub(super) fn open(&self, page: &Path) {
        self.post("/url", &json!({ "url": format!("file://{}", page.display()) }));
    }

    /// What this script returns.
    pub(super) fn eval(&self, script: &str) -> Value {
        self.post("/execute/sync", &json!({ "script": script, "args": [] }))
    }

    /// What this script hands to the function that is its last argument.
    pub(super) fn eval_later(&self, script: &str) -> Value {
        self.post("/execute/async", &json!({ "script": script, "args": [] }))
    }

    /// Presses keys in the first element that this selector finds.
    pub(super) fn keys(&self, selector: &str, keys: &str) {
        let element = self.element(selector);
        self.post(&format!("/element/{element}/value"), &json!({ "text": keys }));
    }

    pub(super) fn click(&self, selector: &str) {
        let element = self.element(selector);
        self.post(&format!("/element/{element}/click"), &json!({}));
    }

    fn element(&self, selector: &str) -> String {
        let find = json!({ "using": "css selector", "value": selector });
        let found = self.post("/element", &find);
        let id = found.as_object().and_then(|found| found.values().next());
        id.and_then(Value::as_str).unwrap_or_else(|| panic!("{selector}: {found}")).to_owned()
    }

    /// Drags the mouse from one place of the window to another.
    pub(super) fn drag(&self, (from_x, from_y): (i64, i64), (to_x, to_y): (i64, i64)) {
        let to = |x: i64, y: i64| json!({ "type": "pointerMove", "duration": 50, "x": x, "y": y });
        let actions = json!([
            to(from_x, from_y),
            { "type": "pointerDown", "button": 0 },
            to((from_x + to_x) / 2, to_y),
            to(to_x, to_y),
            { "type": "pointerUp", "button": 0 },
        ]);
        let mouse = json!({ "type": "pointer", "id": "mouse", "actions": actions });
        self.post("/actions", &json!({ "actions": [mouse] }));
    }

    /// Makes the window so wide and so high, and the page light or dark.
    pub(super) fn show_as(&self, (width, height): (u32, u32), scheme: &str) {
        let size =
            json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.devtools("Emulation.setDeviceMetricsOverride", &size);
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.devtools("Emulation.setEmulatedMedia", &features);
    }

    fn devtools(&self, command: &str, parameters: &Value) {
        self.post("/goog/cdp/execute", &json!({ "cmd": command, "params": parameters }));
    }

    /// The page as a PNG picture.
    pub(super) fn picture(&self) -> Vec<u8> {
        decoded(&self.get("/screenshot"))
    }

    /// The page as PDF, in centimetres.
    pub(super) fn pdf(&self, (width, height): (f64, f64)) -> Vec<u8> {
        decoded(&self.post("/print", &json!({ "page": { "width": width, "height": height } })))
    }

    /// What the page has told the console since the last call.
    pub(super) fn console(&self) -> Vec<String> {
        let log = self.post("/se/log", &json!({ "type": "browser" }));
        let lines = log.as_array().map(Vec::as_slice).unwrap_or_default();
        lines.iter().map(|line| line["message"].to_string()).collect()
    }

    fn post(&self, path: &str, body: &Value) -> Value {
        let mut answer =
            self.agent.post(format!("{}{path}", self.session)).send_json(body).expect(path);
        value(path, answer.body_mut().with_config().limit(64 << 20).read_json().expect("JSON"))
    }

    fn get(&self, path: &str) -> Value {
        let mut answer = self.agent.get(format!("{}{path}", self.session)).call().expect(path);
        value(path, answer.body_mut().with_config().limit(64 << 20).read_json().expect("JSON"))
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // The session first, so that no Chromium stays behind.
        let _ = self.agent.delete(&self.session).call();
        let _ = self.driver.kill();
        let _ = self.driver.wait();
    }
}

fn value(path: &str, mut answer: Value) -> Value {
    let value = answer["value"].take();
    assert!(value.get("error").is_none(), "{path}: {}", value["message"]);
    value
}

fn decoded(base64: &Value) -> Vec<u8> {
    BASE64_STANDARD.decode(base64.as_str().expect("base64")).expect("base64")
}

/// The port that the driver has found for itself.
fn port(stdout: std::process::ChildStdout) -> u16 {
    let (sender, lines) = channel();
    thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    let until = Instant::now() + PATIENCE;
    loop {
        let left = until.saturating_duration_since(Instant::now());
        let line = lines.recv_timeout(left).expect("chromedriver says on which port it is");
        // Before that it says that it starts on port 0.
        let Some((_, port)) = line.split_once("successfully on port ") else { continue };
        if let Ok(port) = port.trim_end_matches('.').parse() {
            return port;
        }
    }
}
