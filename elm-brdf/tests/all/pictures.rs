//! `render` and `export` as a user runs them: what is written, and what an interruption leaves.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use crate::support::Program;

#[test]
fn an_interrupted_render_leaves_the_old_picture_and_nothing_else() {
    let dir = tempfile::tempdir().unwrap();
    let picture = dir.path().join("picture.png");
    std::fs::write(&picture, "the old one").unwrap();
    // Far more samples than this test waits for.
    let mut render = Command::new(env!("CARGO_BIN_EXE_elm-brdf"))
        .args([
            "render",
            "builtin:mesh",
            "--size",
            "1920x1080",
            "--samples",
            "65536",
        ])
        .args(["--threads", "1", "-o"])
        .arg(&picture)
        .env_remove("ELM_BRDF_DATA")
        .env("XDG_CACHE_HOME", dir.path().join("no-cache"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(700));
    assert!(render.try_wait().unwrap().is_none(), "it is already done");
    render.kill().unwrap();
    render.wait().unwrap();
    assert_eq!(std::fs::read(&picture).unwrap(), b"the old one");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn export_writes_the_form_that_the_extension_or_the_format_asks_for() {
    let dir = tempfile::tempdir().unwrap();
    for (file, more, beginning) in [
        ("a.glsl", &["--name", "slate"][..], "// slate_eval: "),
        ("a.wgsl", &[], "// elm_eval: "),
        ("a.hlsl", &[], "// elm_eval: "),
        ("a.c", &[], "// elm_eval: "),
        ("a.txt", &["--format", "wgsl"], "// elm_eval: "),
    ] {
        let path = dir.path().join(file);
        let mut arguments = vec!["export", "curet:7", "-o", path.to_str().unwrap()];
        arguments.extend(more);
        assert_eq!(Program::new().output(&arguments), "");
        let text = std::fs::File::open(&path).unwrap();
        let first = BufReader::new(text).lines().next().unwrap().unwrap();
        assert!(first.starts_with(beginning), "{file}: {first}");
    }
    let written: Vec<_> = std::fs::read_dir(dir.path()).unwrap().collect();
    assert_eq!(written.len(), 5);
}
