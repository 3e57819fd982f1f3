//! A cluster of processes on this machine, whose executors are killed.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ballista_core::config::TaskSchedulingPolicy;
use ballista_executor::executor_process::{ExecutorProcessConfig, start_executor_process};

use crate::program::elm;

/// A program that ends with the test.
struct Running(Child);

impl Running {
    /// Started, and said to be ready by its first line.
    fn start(folder: &Path, arguments: &[&str]) -> (Self, String) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_elm"))
            .args(arguments)
            .current_dir(folder)
            // What a killed executor leaves goes with the folder.
            .env("TMPDIR", folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut lines = BufReader::new(child.stdout.take().unwrap());
        lines.read_line(&mut line).unwrap();
        (Self(child), line)
    }

    fn kill(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
    }
}

struct Cluster {
    address: String,
    executors: Vec<Running>,
    _scheduler: Running,
}

impl Cluster {
    fn start(folder: &Path, executors: usize) -> Self {
        let (scheduler, line) = Running::start(folder, &["scheduler", "--port", "0"]);
        let address = line.trim().strip_prefix("scheduler at ").unwrap();
        let arguments = ["executor", "--scheduler", address, "--threads", "1"];
        let start = |_| {
            let (executor, line) = Running::start(folder, &arguments);
            assert!(line.starts_with("executor at "), "{line}");
            executor
        };
        Self {
            executors: (0..executors).map(start).collect(),
            address: address.to_owned(),
            _scheduler: scheduler,
        }
    }
}

const FIT: [&str; 4] = ["fit", "rows-*.parquet", "--target", "y"];

/// `elm fit` of all rows to a file, by the cluster at this address.
fn fit(folder: &Path, address: &str, seconds: &str, rest: &[&str], output: &str) -> Output {
    let limit = ["--cluster", address, "--time-limit", seconds];
    elm(folder, &[&FIT, rest, &["-o", output], &limit].concat())
}

/// Four files of ten thousand rows.
fn rows(folder: &Path) {
    for file in 0..4 {
        let query = format!(
            "SELECT value % 20 AS sensor, sin(value * 0.7) AS a, cos(value * 1.3) AS b,
                    sin(value * 0.7) * cos(value * 1.3) + value % 20 AS y
             FROM generate_series({}, {})",
            10_000 * file + 1,
            10_000 * (file + 1)
        );
        let output = elm(
            folder,
            &["sql", &query, "-o", &format!("rows-{file}.parquet")],
        );
        assert!(output.status.success());
    }
}

/// One line, and no file.
fn refused(folder: &Path, output: &Output, file: &str) -> String {
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert_eq!(error.trim().lines().count(), 1, "{error}");
    assert!(!folder.join(file).exists());
    error
}

#[test]
fn a_killed_executor_changes_nothing_or_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    let one: &[&str] = &["--neurons", "150"];
    let groups: &[&str] = &["--neurons", "40", "--group-by", "sensor"];
    for (rest, end) in [(one, "elm"), (groups, "parquet")] {
        let (own, theirs) = (format!("own.{end}"), format!("theirs.{end}"));
        let embedded = elm(folder, &[&FIT, rest, &["-o", &own]].concat());
        assert!(embedded.status.success(), "{embedded:?}");
        // Rows of groups come in another order.
        let models = |file: &str| {
            if end == "elm" {
                return fs::read(folder.join(file)).unwrap();
            }
            let query = format!("SELECT sensor, model FROM '{file}' ORDER BY sensor");
            elm(folder, &["sql", &query]).stdout
        };
        let cluster = Cluster::start(folder, 3);
        let start = Instant::now();
        let output = fit(folder, &cluster.address, "60", rest, &theirs);
        let whole = start.elapsed();
        assert!(output.status.success(), "{output:?}");
        assert!(models(&own) == models(&theirs));
        drop(cluster);
        for part in [0.4, 0.9] {
            fs::remove_file(folder.join(&theirs)).unwrap();
            let mut cluster = Cluster::start(folder, 3);
            let mut killed = cluster.executors.remove(0);
            let killer = std::thread::spawn(move || {
                std::thread::sleep(whole.mul_f64(part));
                killed.kill();
            });
            let output = fit(folder, &cluster.address, "60", rest, &theirs);
            killer.join().unwrap();
            if output.status.success() {
                assert!(models(&own) == models(&theirs), "killed after {part}");
            } else {
                println!("{}", refused(folder, &output, &theirs));
                fs::write(folder.join(&theirs), "").unwrap();
            }
        }
    }
}

#[test]
fn what_a_cluster_lacks_is_one_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    rows(folder);
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = nobody.local_addr().unwrap();
    drop(nobody);
    let refusal = |address: &str, seconds: &str| {
        let output = fit(folder, address, seconds, &[], "m.elm");
        refused(folder, &output, "m.elm")
    };
    let error = refusal(&address.to_string(), "60");
    assert!(
        error.contains(&format!("no scheduler at {address}")),
        "{error}"
    );

    // Ballista's own executor, which has not the functions.
    let cluster = Cluster::start(folder, 0);
    let port = cluster.address.rsplit_once(':').unwrap().1.parse().unwrap();
    let config = ExecutorProcessConfig {
        port: address.port(),
        scheduler_host: "127.0.0.1".to_owned(),
        scheduler_port: port,
        task_scheduling_policy: TaskSchedulingPolicy::PullStaged,
        ..ExecutorProcessConfig::default()
    };
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.spawn(start_executor_process(Arc::new(config)));
    std::thread::sleep(Duration::from_secs(1));
    let error = refusal(&cluster.address, "60");
    println!("{error}");
    assert!(error.contains("elm_sample"), "{error}");
    runtime.shutdown_background();

    let error = refusal(&cluster.address, "2");
    assert!(error.contains("no result within 2 s"), "{error}");
}
