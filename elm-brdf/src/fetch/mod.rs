//! Fetching the CUReT database from the web.
//!
//! The page of the database is read for its links, so that files that have moved are found as long
//! as the page knows them. Nothing is written before all files are there, each is seen to be a
//! whole file of the database, and the two whose SHA-256 sums are known have those sums.
//!
//! **The database's own host could not be reached when this was written**: [`CURET_PAGE`] is the
//! address under which the page was last known, and the page's wording is what a stored copy of it
//! says. Everything is tested against a server on the same machine.

mod links;

use std::fmt::Write as _;
use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use elm_datasets::curet;
use iri_string::types::{UriReferenceStr, UriStr};
use sha2::{Digest, Sha256};
use ureq::{Agent, ResponseExt};

use links::{Link, links};

/// Where the database's page was last known to be.
pub const CURET_PAGE: &str = "https://www.cs.columbia.edu/CAVE/software/curet/html/brdfm.html";

/// The SHA-256 sums that are known, of the files that all results here rest on.
const KNOWN: [(&str, &str); 2] = [
    (
        "abrdf.dat",
        "3c0eeba4a1e1b4399c4e92e13db379ed76d87bc6283a3c9b9912cd895d41a089",
    ),
    (
        curet::TABLE,
        "a6e98df710faf2df3ce7bd4bf94a6082dbbea813579a5489250a45de8496657f",
    ),
];

/// Forty times the largest of the files.
const MAX_BYTES: u64 = 4 << 20;

/// Why files could not be fetched. Each is one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An address that cannot be asked.
    #[error("expected an address that begins with http:// or https://, found {text:?}")]
    Address {
        /// The text.
        text: String,
    },
    /// The server has no such page, or says no.
    #[error("{url}: the server answers with status {status}")]
    Status {
        /// The address.
        url: String,
        /// The HTTP status, 400 or more.
        status: u16,
    },
    /// No answer, or not all of it.
    #[error("cannot get {url}: {reason}")]
    Transfer {
        /// The address.
        url: String,
        /// What went wrong.
        reason: Box<dyn std::error::Error + Send + Sync>,
    },
    /// More bytes than a file of the database can have.
    #[error("{url}: expected at most {MAX_BYTES} bytes, found more")]
    TooLarge {
        /// The address.
        url: String,
    },
    /// A page without a link that must be there.
    #[error("{page}: expected a link to {file}, found none")]
    NoLink {
        /// The page's address, after redirects.
        page: String,
        /// The file.
        file: &'static str,
    },
    /// A file that is not what it should be; the address stands in the place of the file.
    #[error(transparent)]
    Content(#[from] elm_datasets::Error),
    /// A file that is whole, but not the one that is known.
    #[error("{url}: expected the SHA-256 sum {expected}, found {found}")]
    Changed {
        /// The address.
        url: String,
        /// The sum that is known.
        expected: &'static str,
        /// The sum of the bytes that came.
        found: String,
    },
    /// The file system refuses.
    #[error("cannot write {}: {reason}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system said.
        reason: io::Error,
    },
}

/// What to do with a file that is whole, but whose sum is not the one known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Changed {
    /// Fail, and write nothing: results could not be compared with any printed ones.
    #[default]
    Refuse,
    /// Take it.
    Accept,
}

/// How far a transfer has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// What is being fetched.
    pub file: &'static str,
    /// How many have been fetched before it.
    pub done: usize,
    /// How many there are, the page included.
    pub all: usize,
    /// Bytes of it that have come.
    pub bytes: u64,
}

/// A file that was fetched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fetched {
    /// Its name in the folder.
    pub file: &'static str,
    /// Where it came from, after redirects.
    pub url: String,
    /// Its length.
    pub bytes: usize,
    /// Its SHA-256 sum, in hexadecimal.
    pub sha256: String,
    /// Whether that is the sum known; `None` if none is.
    pub as_known: Option<bool>,
}

/// Fetches the direction table and the four value files of CUReT into `dir`, which is made if it
/// is not there. Files of these names are replaced, each in one step, the table last.
///
/// `page` is the address of a page with links to files of these names, wherever they are; the table
/// may also be a link of another name whose text speaks of a table.
///
/// # Errors
/// [`Error`]; unless it is [`Error::Write`], nothing has been written.
pub fn curet(
    page: &str,
    dir: &Path,
    changed: Changed,
    mut progress: impl FnMut(Progress),
) -> Result<Vec<Fetched>, Error> {
    let agent: Agent = Agent::config_builder()
        .user_agent(concat!("elm-brdf/", env!("CARGO_PKG_VERSION")))
        .timeout_connect(Some(Duration::from_secs(20)))
        .timeout_global(Some(Duration::from_secs(120)))
        .build()
        .into();
    let all = curet::VALUES.len() + 2;
    let mut step = |file, done, bytes| {
        progress(Progress {
            file,
            done,
            all,
            bytes,
        });
    };
    let html = get(&agent, page, |bytes| step("page", 0, bytes))?;
    let links = links(&String::from_utf8_lossy(&html.bytes));

    let mut fetched = Vec::new();
    // The table comes last, so that an interrupted run leaves no folder that looks complete.
    for (index, file) in curet::VALUES.into_iter().chain([curet::TABLE]).enumerate() {
        let url = find(&links, file, &html.url)?;
        let body = get(&agent, &url, |bytes| step(file, index + 1, bytes))?;
        if file == curet::TABLE {
            curet::parse_table(&body.bytes, &body.url)?;
        } else {
            curet::parse_values(&body.bytes, &body.url)?;
        }
        let sha256 = hexadecimal(&Sha256::digest(&body.bytes));
        let known = KNOWN.into_iter().find(|&(name, _)| name == file);
        let as_known = known.map(|(_, sum)| sum == sha256);
        if let (Some((_, expected)), Some(false), Changed::Refuse) = (known, as_known, changed) {
            return Err(Error::Changed {
                url: body.url,
                expected,
                found: sha256,
            });
        }
        let description = Fetched {
            file,
            url: body.url,
            bytes: body.bytes.len(),
            sha256,
            as_known,
        };
        fetched.push((description, body.bytes));
    }
    for (description, bytes) in &fetched {
        let path = dir.join(description.file);
        fs::create_dir_all(dir)
            .and_then(|()| elm::persist::replace(&path, bytes))
            .map_err(|reason| Error::Write { path, reason })?;
    }
    Ok(fetched.into_iter().map(|(file, _)| file).collect())
}

/// The address that a page's links give for a file.
fn find(links: &[Link], file: &'static str, page: &str) -> Result<String, Error> {
    let named = |link: &&Link| link.file().eq_ignore_ascii_case(file);
    let spoken =
        |link: &&Link| file == curet::TABLE && link.text.to_ascii_lowercase().contains("table");
    // A link that is no address, or leads to no web page, counts as none.
    let address = |link: &Link| {
        let base: &UriStr = page.try_into().ok()?;
        let reference: &UriReferenceStr = link.href.as_str().try_into().ok()?;
        let url = reference.resolve_against(base.to_absolute()).to_string();
        web(&url).then_some(url)
    };
    let by_name = links.iter().filter(named).find_map(address);
    by_name
        .or_else(|| links.iter().filter(spoken).find_map(address))
        .ok_or_else(|| Error::NoLink {
            page: page.to_owned(),
            file,
        })
}

fn web(url: &str) -> bool {
    let starts = |scheme: &str| {
        let start = url.as_bytes().get(..scheme.len());
        start.is_some_and(|start| start.eq_ignore_ascii_case(scheme.as_bytes()))
    };
    starts("http://") || starts("https://")
}

/// What came from an address.
struct Body {
    bytes: Vec<u8>,
    /// The address after redirects.
    url: String,
}

fn get(agent: &Agent, url: &str, mut progress: impl FnMut(u64)) -> Result<Body, Error> {
    if !web(url) || <&UriStr>::try_from(url).is_err() {
        let text = url.to_owned();
        return Err(Error::Address { text });
    }
    progress(0);
    let failed = |reason: Box<dyn std::error::Error + Send + Sync>| Error::Transfer {
        url: url.to_owned(),
        reason,
    };
    let response = agent.get(url).call().map_err(|error| match error {
        ureq::Error::StatusCode(status) => Error::Status {
            url: url.to_owned(),
            status,
        },
        other => failed(other.into()),
    })?;
    let last = response.get_uri().to_string();
    // One byte more than is allowed tells that there are too many.
    let mut stream = response.into_body().into_reader().take(MAX_BYTES + 1);
    let mut bytes = Vec::new();
    let mut block = [0; 1 << 13];
    loop {
        match stream.read(&mut block) {
            Ok(0) => break,
            Ok(count) => bytes.extend_from_slice(block.get(..count).unwrap_or_default()),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(failed(error.into())),
        }
        progress(bytes.len() as u64);
    }
    if bytes.len() as u64 > MAX_BYTES {
        let url = url.to_owned();
        return Err(Error::TooLarge { url });
    }
    Ok(Body { bytes, url: last })
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}
