//! `elm-brdf fetch curet` against a server on this machine. The database's own host is not asked.

use std::collections::HashMap;
use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::thread;

use crate::support::Program;
use elm_brdf::fetch::{self, Changed, Error, Fetched};
use elm_datasets::{Invalid, MaterialId, curet, synthetic};

/// What a server says to each path: all bytes of its answer.
type Answers = HashMap<String, Vec<u8>>;

/// Serves these answers until the test ends; gives the address without a path.
fn serve(answers: Answers) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let _ = answer(stream, &answers);
        }
    });
    address
}

fn answer(mut stream: TcpStream, answers: &Answers) -> std::io::Result<()> {
    let mut request = Vec::new();
    let mut block = [0; 1024];
    while !request.windows(4).any(|end| end == b"\r\n\r\n") {
        match stream.read(&mut block)? {
            0 => break,
            count => request.extend(&block[..count]),
        }
    }
    let text = String::from_utf8_lossy(&request).into_owned();
    let path = text.split(' ').nth(1).unwrap_or_default();
    let none = response("404 Not Found", "", b"nothing here");
    stream.write_all(answers.get(path).unwrap_or(&none))
}

fn response(status: &str, header: &str, body: &[u8]) -> Vec<u8> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Length: {length}\r\nConnection: close\r\n{header}\r\n"
    );
    [head.as_bytes(), body].concat()
}

fn ok(body: impl AsRef<[u8]>) -> Vec<u8> {
    response("200 OK", "", body.as_ref())
}

fn moved(to: &str) -> Vec<u8> {
    response("301 Moved Permanently", &format!("Location: {to}\r\n"), b"")
}

/// The page as its wording is known, with links as its author might have made them.
const PAGE: &str = r#"<html><head><title>BRDF</title></head><body>
<a href="mailto:someone@example.org">write</a> <a href="ftp://example.org/abrdf.dat">by ftp</a>
<a href="../index.html">up</a> <a name="top">BRDF Measurement Database</a>
<!-- <a href="old/abrdf.dat">abrdf.dat</a> -->
A <A HREF="/curet/data/table.txt">table</A> is provided. The ascii file
<a href='../data/abrdf.dat'>abrdf.dat</a> gives the measurements. Similarly,
<a href=../data/rbrdf.dat>rbrdf.dat</a>, <a href="http:../data/gbrdf.dat">wrong</a>
<a href="../data/gbrdf.dat#top">gbrdf.dat</a> and <a href="ABSOLUTE/curet/data/bbrdf.dat">bbrdf.dat</a>
give the red, green and blue. <a href="http://[broken">x</a> <a href="bad link/abrdf.dat">x</a>
"#;

/// The files of the synthetic data, in the database's layout.
fn synthetic_files() -> Vec<(String, Vec<u8>)> {
    let dir = tempfile::tempdir().unwrap();
    let all: Vec<MaterialId> = MaterialId::all().collect();
    let mut set = synthetic::measurements(1, &all, Invalid::Keep);
    curet::write(dir.path(), &set).unwrap();
    set.channels = vec!["average".to_owned()];
    for material in &mut set.materials {
        let mean = material.values.mean_axis(ndarray::Axis(1)).unwrap();
        material.values = mean.insert_axis(ndarray::Axis(1));
    }
    curet::write(dir.path(), &set).unwrap();
    fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, fs::read(entry.path()).unwrap())
        })
        .collect()
}

/// A site with the page and these files.
fn site(files: &[(String, Vec<u8>)]) -> Answers {
    let mut answers = Answers::new();
    answers.insert("/curet/html/brdfm.html".to_owned(), ok(PAGE));
    for (name, bytes) in files {
        answers.insert(format!("/curet/data/{name}"), ok(bytes));
    }
    answers
}

/// Serves the answers, with the page's absolute link made to lead to the server itself.
fn start(mut answers: Answers) -> String {
    // The port is only known once the server runs: the absolute link goes by way of a redirect.
    let page = PAGE.replace("ABSOLUTE", "//HOST");
    let other = serve(answers.clone());
    let host = other.trim_start_matches("http://");
    if answers.get("/curet/html/brdfm.html") == Some(&ok(PAGE)) {
        let page = ok(page.replace("HOST", host));
        answers.insert("/curet/html/brdfm.html".to_owned(), page);
    }
    serve(answers)
}

fn try_fetch(answers: Answers, dir: &Path, changed: Changed) -> Result<Vec<Fetched>, Error> {
    let page = format!("{}/curet/html/brdfm.html", start(answers));
    fetch::curet(&page, dir, changed, |_| {})
}

#[test]
fn all_five_files_are_fetched_from_relative_and_absolute_links_of_one_page() {
    let files = synthetic_files();
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().join("deep/curet");
    let fetched = try_fetch(site(&files), &to, Changed::Accept).unwrap();
    assert_eq!(fetched.len(), 5);
    assert_eq!(fetched.last().unwrap().file, "table.txt");
    assert_eq!(fs::read_dir(&to).unwrap().count(), 5);
    for (name, bytes) in &files {
        assert!(fs::read(to.join(name)).unwrap() == *bytes, "{name}");
        let file = fetched.iter().find(|file| file.file == name).unwrap();
        assert_eq!(file.bytes, bytes.len());
        assert_eq!(file.sha256.len(), 64);
        let known = ["abrdf.dat", "table.txt"].contains(&name.as_str());
        assert_eq!(file.as_known, known.then_some(false), "{name}");
    }
    assert!(curet::is_present(&to));
}

#[test]
fn redirects_are_followed_and_links_are_relative_to_where_they_end() {
    let mut answers = site(&synthetic_files());
    answers.insert("/old".to_owned(), moved("/curet/html/brdfm.html"));
    let file = answers.remove("/curet/data/rbrdf.dat").unwrap();
    answers.insert("/curet/data/rbrdf.dat".to_owned(), moved("../new/r.dat"));
    answers.insert("/curet/new/r.dat".to_owned(), file);
    let dir = tempfile::tempdir().unwrap();
    let page = format!("{}/old", start(answers));
    let fetched = fetch::curet(&page, dir.path(), Changed::Accept, |_| {}).unwrap();
    let red = fetched
        .iter()
        .find(|file| file.file == "rbrdf.dat")
        .unwrap();
    assert!(red.url.ends_with("/curet/new/r.dat"), "{}", red.url);
}

#[test]
fn a_circle_of_redirects_ends_in_an_error() {
    let mut answers = Answers::new();
    answers.insert("/a".to_owned(), moved("/b"));
    answers.insert("/b".to_owned(), moved("/a"));
    let dir = tempfile::tempdir().unwrap();
    let page = format!("{}/a", serve(answers));
    let error = fetch::curet(&page, dir.path(), Changed::Accept, |_| {}).unwrap_err();
    assert!(matches!(error, Error::Transfer { .. }), "{error}");
}

#[test]
fn a_table_of_another_name_is_known_by_the_words_of_its_link() {
    let mut answers = site(&synthetic_files());
    let table = answers.remove("/curet/data/table.txt").unwrap();
    answers.insert("/curet/data/angles".to_owned(), table);
    let page = PAGE.replace("/curet/data/table.txt", "../data/angles");
    let page = page.replace("ABSOLUTE/curet", "/curet");
    answers.insert("/curet/html/brdfm.html".to_owned(), ok(page));
    let dir = tempfile::tempdir().unwrap();
    try_fetch(answers, dir.path(), Changed::Accept).unwrap();
    assert!(dir.path().join("table.txt").is_file());
}

/// An edit of a site.
type Edit = fn(&mut Answers);

fn truncated(answer: &[u8]) -> Vec<u8> {
    answer[..answer.len() - 1000].to_vec()
}

/// What is wrong, the edit, and what the message must contain.
#[rustfmt::skip]
const FAULTS: &[(&str, Edit, &[&str])] = &[
    ("no page", |a| { a.remove("/curet/html/brdfm.html"); }, &["brdfm.html", "status 404"]),
    ("no file", |a| { a.remove("/curet/data/gbrdf.dat"); }, &["data/gbrdf.dat", "status 404"]),
    ("no table", |a| { a.remove("/curet/data/table.txt"); }, &["data/table.txt", "status 404"]),
    ("broken server", |a| { a.insert("/curet/data/rbrdf.dat".into(), response("500 Oops", "", b"")); }, &["data/rbrdf.dat", "status 500"]),
    ("page cut off", |a| { a.insert("/curet/html/brdfm.html".into(), truncated(&ok([b'x'; 2000]))); }, &["cannot get", "brdfm.html"]),
    ("file cut off", |a| { let x = truncated(&a["/curet/data/rbrdf.dat"]); a.insert("/curet/data/rbrdf.dat".into(), x); }, &["cannot get", "data/rbrdf.dat"]),
    ("no answer", |a| { a.insert("/curet/data/rbrdf.dat".into(), Vec::new()); }, &["cannot get", "data/rbrdf.dat"]),
    ("no HTTP", |a| { a.insert("/curet/data/rbrdf.dat".into(), b"220 ftp\r\n\r\n".to_vec()); }, &["cannot get", "data/rbrdf.dat"]),
    ("a page without links", |a| { a.insert("/curet/html/brdfm.html".into(), ok("moved away")); }, &["brdfm.html", "link to abrdf.dat"]),
    ("an empty page", |a| { a.insert("/curet/html/brdfm.html".into(), ok("")); }, &["link to abrdf.dat"]),
    ("a page in place of a file", |a| { a.insert("/curet/data/abrdf.dat".into(), ok("<html>sorry")); }, &["data/abrdf.dat", "line 1", "number of a material", "<html>sorry"]),
    ("a shorter file", |a| { a.insert("/curet/data/table.txt".into(), ok("1 0.1 0 0.1 0\n")); }, &["data/table.txt", "measurement 2 is missing"]),
    ("a flood", |a| { a.insert("/curet/data/abrdf.dat".into(), ok(vec![b'1'; (4 << 20) + 1])); }, &["data/abrdf.dat", "at most 4194304 bytes"]),
];

#[test]
fn faults_are_reported_with_the_address_and_nothing_is_written() {
    let files = synthetic_files();
    for (what, edit, fragments) in FAULTS {
        let mut answers = site(&files);
        edit(&mut answers);
        let dir = tempfile::tempdir().unwrap();
        let to = dir.path().join("curet");
        let Err(error) = try_fetch(answers, &to, Changed::Accept) else {
            panic!("{what}: fetched without an error")
        };
        let message = error.to_string();
        for fragment in *fragments {
            assert!(
                message.contains(fragment),
                "{what}: no {fragment:?} in {message:?}"
            );
        }
        assert!(!message.contains('\n'), "{what}: {message}");
        assert!(!to.exists(), "{what}");
    }
}

#[test]
fn a_file_with_another_sum_is_refused_and_the_old_ones_stay() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("table.txt"), "old").unwrap();
    let error = try_fetch(site(&synthetic_files()), dir.path(), Changed::Refuse).unwrap_err();
    assert!(matches!(error, Error::Changed { .. }), "{error}");
    assert_eq!(fs::read(dir.path().join("table.txt")).unwrap(), b"old");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn addresses_that_cannot_be_asked_are_named() {
    let dir = tempfile::tempdir().unwrap();
    for text in [
        "",
        "curet",
        "ftp://example.org/",
        "file:///etc/passwd",
        "http://a b/",
        "http://",
    ] {
        let error = fetch::curet(text, dir.path(), Changed::Refuse, |_| {}).unwrap_err();
        assert!(!error.to_string().contains('\n'), "{text}: {error}");
        if text != "http://" {
            assert!(matches!(error, Error::Address { .. }), "{text}: {error}");
        }
    }
    // A port that was free a moment ago.
    let free = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let error = fetch::curet(
        &format!("http://{free}/"),
        dir.path(),
        Changed::Refuse,
        |_| {},
    );
    assert!(matches!(error, Err(Error::Transfer { .. })));
}

#[test]
fn progress_goes_from_the_page_to_the_last_file() {
    let dir = tempfile::tempdir().unwrap();
    let page = format!("{}/curet/html/brdfm.html", start(site(&synthetic_files())));
    let mut seen = Vec::new();
    fetch::curet(&page, dir.path(), Changed::Accept, |progress| {
        seen.push(progress);
    })
    .unwrap();
    assert_eq!((seen[0].file, seen[0].done, seen[0].bytes), ("page", 0, 0));
    let last = seen.last().unwrap();
    assert_eq!((last.file, last.done, last.all), ("table.txt", 5, 6));
    assert!(seen.windows(2).all(|pair| pair[0].done <= pair[1].done));
}

/// The real files, with the average in place of the channels, which are not at hand.
fn real() -> Option<Vec<(String, Vec<u8>)>> {
    let dir = elm_test_support::curet()?;
    let read = |name| fs::read(dir.join(name)).unwrap();
    let values = ["abrdf.dat", "rbrdf.dat", "gbrdf.dat", "bbrdf.dat"];
    let mut files = values
        .map(|name| (name.to_owned(), read("abrdf.dat")))
        .to_vec();
    files.push(("table.txt".to_owned(), read("table.txt")));
    Some(files)
}

#[test]
#[ignore = "in a build with the feature fetch, needs data: CUReT"]
fn the_real_files_have_the_sums_known() {
    let Some(files) = real() else { return };
    let dir = tempfile::tempdir().unwrap();
    let fetched = try_fetch(site(&files), dir.path(), Changed::Refuse).unwrap();
    let known: Vec<_> = fetched.iter().filter_map(|file| file.as_known).collect();
    assert_eq!(known, [true, true]);
}

#[test]
fn reproduce_uses_what_fetch_has_put_into_the_cache() {
    let page = format!("{}/curet/html/brdfm.html", start(site(&synthetic_files())));
    let program = Program::new();
    let assert = program
        .command()
        .args(["fetch", "curet", "--accept-changed", "--from", &page])
        .assert()
        .success();
    let output = assert.get_output().clone();
    let (out, errors) = (
        String::from_utf8(output.stdout).unwrap(),
        String::from_utf8(output.stderr).unwrap(),
    );
    assert_eq!(out.lines().count(), 6, "{out}");
    assert!(
        out.contains("table.txt") && out.contains("written to"),
        "{out}"
    );
    // Without a terminal there is no progress bar, but there are the warnings.
    assert_eq!(errors.lines().count(), 2, "{errors}");
    assert!(errors.starts_with("warning: abrdf.dat"), "{errors}");
    assert!(curet::is_present(&program.cache().join("elm-brdf/curet")));
    let report = program.output(&["reproduce", "--materials", "1", "--format", "json"]);
    assert!(report.contains("CUReT files in"), "{report}");
}

#[test]
fn the_command_says_in_one_line_what_is_wrong() {
    let page = format!("{}/curet/html/brdfm.html", start(site(&synthetic_files())));
    let gone = format!("{}/gone", serve(Answers::new()));
    for (arguments, code, fragments) in [
        (
            &["fetch", "curet", "--from", "ftp://example.org"][..],
            2,
            ["--from", "http://"],
        ),
        (&["fetch"], 2, ["error:", "--help"]),
        (&["fetch", "merl"], 2, ["merl", "--help"]),
        (&["fetch", "curet", "--from", &gone], 1, ["/gone", "404"]),
        (
            &["fetch", "curet", "--from", &page],
            1,
            ["SHA-256", "--accept-changed"],
        ),
    ] {
        let (line, found) = Program::new().refusal(arguments);
        assert_eq!(found, code, "{arguments:?}: {line}");
        assert_eq!(line.lines().count(), 1, "{line}");
        for fragment in fragments {
            assert!(line.contains(fragment), "{arguments:?}: {line}");
        }
    }
}
