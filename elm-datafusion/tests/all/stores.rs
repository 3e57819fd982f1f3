//! Files at URLs, from a server on this machine that answers as stores of objects do.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::program::{elm, rows};

/// Serves a folder: GET and HEAD, ranges, and the lists of an S3 bucket. Returns its address.
fn serve(folder: PathBuf) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let folder = folder.clone();
            std::thread::spawn(move || answer_all(&stream, &folder));
        }
    });
    address.to_string()
}

/// The requests of a connection, one after another.
fn answer_all(stream: &TcpStream, folder: &Path) {
    let mut lines = BufReader::new(stream).lines();
    while let Some(Ok(request)) = lines.next() {
        let mut range = None;
        for line in lines.by_ref().map_while(Result::ok) {
            let Some((name, value)) = line.split_once(": ") else {
                break;
            };
            if name.eq_ignore_ascii_case("range") {
                range = value.strip_prefix("bytes=").map(str::to_owned);
            }
        }
        let (method, path) = request.split_once(' ').unwrap();
        let path = path.split(' ').next().unwrap();
        if method != "GET" && method != "HEAD" {
            let mut stream = stream;
            let _ = stream.write_all(b"HTTP/1.1 405 Method Not Allowed\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
            return;
        }
        let (mut head, body) = answer(folder, path, range.as_deref());
        head += &format!("content-length: {}\r\n\r\n", body.len());
        let mut stream = stream;
        stream.write_all(head.as_bytes()).unwrap();
        if method == "GET" {
            stream.write_all(&body).unwrap();
        }
    }
}

fn answer(folder: &Path, path: &str, range: Option<&str>) -> (String, Vec<u8>) {
    const MODIFIED: &str = "Sun, 01 Nov 2026 00:00:00 GMT";
    if path.contains("list-type=2") {
        let mut names: Vec<_> = fs::read_dir(folder.join("bucket/rows"))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        let file = |name: &String| {
            format!(
                "<Contents><Key>rows/{name}</Key><Size>1</Size><ETag>\"{name}\"</ETag>\
                 <LastModified>2026-11-01T00:00:00.000Z</LastModified></Contents>"
            )
        };
        let files: String = names.iter().map(file).collect();
        let body =
            format!("<ListBucketResult><IsTruncated>false</IsTruncated>{files}</ListBucketResult>");
        return ("HTTP/1.1 200 OK\r\n".to_owned(), body.into_bytes());
    }
    let Ok(bytes) = fs::read(folder.join(path.trim_start_matches('/'))) else {
        return (
            "HTTP/1.1 404 Not Found\r\n".to_owned(),
            b"<html>\nno page</html>".to_vec(),
        );
    };
    let common = format!("last-modified: {MODIFIED}\r\netag: \"1\"\r\naccept-ranges: bytes\r\n");
    let Some((first, last)) = range.and_then(|range| range.split_once('-')) else {
        return (format!("HTTP/1.1 200 OK\r\n{common}"), bytes);
    };
    let size = bytes.len();
    let (first, last) = match first.parse::<usize>() {
        Ok(first) => (
            first,
            last.parse()
                .map_or(size - 1, |last: usize| last.min(size - 1)),
        ),
        Err(_) => (size - last.parse::<usize>().unwrap().min(size), size - 1),
    };
    let head = format!(
        "HTTP/1.1 206 Partial Content\r\ncontent-range: bytes {first}-{last}/{size}\r\n{common}"
    );
    (head, bytes[first..=last].to_vec())
}

fn at_store(folder: &Path, address: &str, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_elm"))
        .args(arguments)
        .current_dir(folder)
        .env("AWS_ENDPOINT", format!("http://{address}"))
        .env("AWS_ALLOW_HTTP", "true")
        .env("AWS_SKIP_SIGNATURE", "true")
        .env("AWS_REGION", "us-east-1")
        .output()
        .unwrap()
}

#[test]
fn files_at_urls_give_the_models_of_files_here() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir_all(folder.join("bucket/rows")).unwrap();
    rows(folder, "p.csv");
    for name in ["a", "b"] {
        let output = format!("bucket/rows/{name}.parquet");
        assert!(
            elm(folder, &["sql", "SELECT * FROM 'p.csv'", "-o", &output])
                .status
                .success()
        );
    }
    fs::write(folder.join("bucket/rows/c.txt"), "no table").unwrap();
    let address = serve(folder.to_owned());
    let fit = |files: &[&str], output: &str| {
        let arguments = [
            &["fit"],
            files,
            &["--target", "y", "--neurons", "40", "-o", output],
        ];
        let found = at_store(folder, &address, &arguments.concat());
        assert!(found.status.success(), "{found:?}");
        fs::read(folder.join(output)).unwrap()
    };
    let own = fit(
        &["bucket/rows/a.parquet", "bucket/rows/b.parquet"],
        "own.elm",
    );
    let urls = ["a", "b"].map(|name| format!("http://{address}/bucket/rows/{name}.parquet"));
    assert!(own == fit(&[&urls[0], &urls[1]], "http.elm"));
    assert!(own == fit(&["s3://bucket/rows/*.parquet"], "s3.elm"));
    let query = format!("SELECT count(*) FROM '{}'", urls[0]);
    let output = elm(folder, &["sql", &query]);
    assert!(
        String::from_utf8_lossy(&output.stdout).contains("300"),
        "{output:?}"
    );
}

#[test]
fn a_url_without_a_file_is_one_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir_all(folder.join("bucket/rows")).unwrap();
    rows(folder, "p.csv");
    let address = serve(folder.to_owned());
    let absent = format!("http://{address}/bucket/absent.parquet");
    let nobody = TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let unreachable = format!("http://{nobody}/p.csv");
    for (files, expected) in [
        (&[absent.as_str()][..], "absent.parquet"),
        (&[&unreachable], "p.csv"),
        (
            &["s3://bucket/rows/*.parquet"],
            "s3://bucket/rows/*.parquet: no such file",
        ),
        (&["ftp://host/p.csv"], "no store for 'ftp://'"),
        (
            &["http://host/p.csv?version=2"],
            "expected a URL without '?'",
        ),
        (
            &["p.csv", "s3://bucket/p.csv"],
            "expected a file from the same store as p.csv",
        ),
    ] {
        let fit = [&["fit"], files, &["--target", "y", "-o", "m.elm"]].concat();
        let output = at_store(folder, &address, &fit);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        println!("{error}");
        assert_eq!(output.status.code(), Some(1), "{error}");
        assert_eq!(error.trim().lines().count(), 1, "{error}");
        assert!(error.contains(expected), "{error}");
        assert!(!folder.join("m.elm").exists());
    }
}
