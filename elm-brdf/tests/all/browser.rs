//! A page opened in a headless Chromium.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

/// Opens a file, with what may follow its name, and returns what the page says on its console, up
/// to the first message that is `last`. Errors of the page are messages as well.
pub(crate) fn console(chromium: &Path, page: &Path, suffix: &str, last: &str) -> Vec<String> {
    let profile = tempfile::tempdir().unwrap();
    let mut browser = Command::new(chromium)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            // Shaders run on the processor, by the book.
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
            "--enable-unsafe-webgpu",
            "--use-webgpu-adapter=swiftshader",
            "--enable-logging=stderr",
            "--window-size=1280,900",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
        ])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        // It is killed, and leaves its sockets.
        .env("TMPDIR", profile.path())
        .arg(format!("file://{}{suffix}", page.display()))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut messages = Vec::new();
    for line in BufReader::new(browser.stderr.take().unwrap()).split(b'\n') {
        let line = String::from_utf8_lossy(&line.unwrap()).into_owned();
        // [process:thread:time:INFO:CONSOLE:line] "message", source: file (line)
        let Some((_, rest)) = line.split_once(":CONSOLE:") else {
            continue;
        };
        let start = rest.find('"').map_or(0, |at| at + 1);
        let end = rest.rfind("\", source:").unwrap_or(rest.len());
        let message = rest[start..end.max(start)].to_owned();
        // The driver's advice on speed is no message of the page.
        if message.contains("GL Driver Message (OpenGL, Performance") {
            continue;
        }
        let done = message == last;
        messages.push(message);
        if done {
            break;
        }
    }
    // It may have ended by itself.
    let _ = browser.kill();
    browser.wait().unwrap();
    messages
}

/// What shaders compute of pairs of vectors, by `language name`: `shaders.html` runs these jobs.
pub(crate) fn shader_values(
    chromium: &Path,
    jobs: &[Value],
    pairs: &[[[f64; 3]; 2]],
) -> Vec<(String, Vec<[f64; 3]>)> {
    let data = serde_json::json!({ "jobs": jobs, "pairs": pairs });
    let page = include_str!("shaders.html").replace("DATA", &data.to_string());
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("shaders.html");
    std::fs::write(&file, page).unwrap();

    let mut found: Vec<(String, Vec<[f64; 3]>)> = Vec::new();
    for message in console(chromium, &file, "", "done") {
        match message.split_once(' ') {
            // One message a block of values.
            Some(("values", rest)) => {
                let mut words = rest.split(' ');
                let label = format!("{} {}", words.next().unwrap(), words.next().unwrap());
                let numbers: Vec<f64> = words.map(|n| n.parse().unwrap()).collect();
                let rows = numbers.as_chunks::<3>().0;
                match found.last_mut() {
                    Some((last, values)) if *last == label => values.extend(rows),
                    _ => found.push((label, rows.to_vec())),
                }
            }
            Some(("skipped", why)) => elm_test_support::skip(why),
            _ => assert_eq!(message, "done", "the page reports an error"),
        }
    }
    found
}
