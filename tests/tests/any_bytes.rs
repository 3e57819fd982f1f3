//! The readers on a bounded number of random, mutated and committed files; `fuzz/` runs the same
//! checks for as long as one likes.

use std::fs;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use elm_tests::any_bytes::{READERS, Reader};
use proptest::prelude::*;
use proptest::sample::Index;

/// Two tests at once would count each other's memory.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn every_committed_file_is_read_as_its_name_says() {
    let _alone = alone();
    for reader in READERS {
        let dir = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz/corpus"));
        let mut whole = 0;
        for entry in fs::read_dir(dir.join(reader.name)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            let read = reader.check(&fs::read(&path).unwrap());
            // What a fuzzer found may be either.
            if !name.starts_with("found-") {
                let hint = "`cargo run -p elm-tests --bin corpus` writes the seeds anew";
                assert_eq!(
                    read,
                    !name.starts_with("bad-"),
                    "{}: {hint}",
                    path.display()
                );
            }
            whole += usize::from(read);
        }
        assert!(
            whole > 0 || reader.name == "merl",
            "nothing of {} is read",
            reader.name
        );
    }
}

#[test]
fn seeds_are_read_as_their_names_say() {
    let _alone = alone();
    for reader in READERS {
        for seed in (reader.seeds)() {
            let read = reader.check(&seed.bytes);
            assert_eq!(
                read,
                !seed.name.starts_with("bad-"),
                "{}: {}",
                reader.name,
                seed.name
            );
        }
    }
}

#[test]
fn no_place_of_a_file_may_hold_what_is_no_number() {
    let _alone = alone();
    let values: [&[u8]; 5] = [
        &f64::NAN.to_le_bytes(),
        &f64::INFINITY.to_le_bytes(),
        &f64::MAX.to_le_bytes(),
        &f32::NAN.to_le_bytes(),
        &f32::NEG_INFINITY.to_le_bytes(),
    ];
    // Longer seeds are texts and tables, whose numbers are much like one another.
    for reader in READERS {
        for seed in (reader.seeds)()
            .into_iter()
            .filter(|seed| seed.bytes.len() < 2000)
        {
            for (place, value) in
                (0..seed.bytes.len()).flat_map(|place| values.map(|value| (place, value)))
            {
                let mut bytes = seed.bytes.clone();
                let end = bytes.len().min(place + value.len());
                bytes[place..end].copy_from_slice(&value[..end - place]);
                reader.check(&bytes);
            }
        }
    }
}

/// What readers are known to trip over.
const PIECES: [&[u8]; 18] = [
    b"",
    b"1e999",
    b"-1e-999",
    b"NaN",
    b"null",
    b"-0.0",
    b"18446744073709551615",
    b"1e308",
    b"\n",
    b"\r\n\r\n",
    b"\"",
    b",",
    b"[[[[[[[[",
    b"\xff\xfe",
    b"\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01",
    b"\0\0\0\0\0\0\xf0\x7f",
    b"\x01\0\0\0\0\0\0\0",
    b"\xef\xbb\xbf",
];

/// A place, how many bytes are replaced there, and by what: a piece, a byte, or bytes from
/// elsewhere in the file.
type Change = (Index, usize, u8, Index, Option<Index>);

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let change = (
        any::<Index>(),
        0..9_usize,
        any::<u8>(),
        any::<Index>(),
        any::<Option<Index>>(),
    );
    proptest::collection::vec(change, 1..6)
}

fn mutate(mut bytes: Vec<u8>, changes: Vec<Change>) -> Vec<u8> {
    for (place, count, byte, piece, other) in changes {
        let place = place.index(bytes.len() + 1);
        let end = bytes.len().min(place + count);
        let new = match other {
            Some(other) => {
                let from = other.index(bytes.len() + 1);
                bytes[from..bytes.len().min(from + usize::from(byte))].to_vec()
            }
            None if byte % 2 == 0 => vec![byte],
            None => piece.get(&PIECES).to_vec(),
        };
        bytes.splice(place..end, new);
    }
    bytes
}

fn any_reader() -> impl Strategy<Value = Reader> {
    proptest::sample::select(&READERS[..])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn random_bytes_are_read_as_they_must_be(
        reader in any_reader(), bytes in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let _alone = alone();
        reader.check(&bytes);
    }

    #[test]
    fn mutated_seeds_are_read_as_they_must_be(
        reader in any_reader(), seed in any::<Index>(), changes in changes(),
        end in proptest::option::weighted(0.2, any::<Index>()),
    ) {
        let _alone = alone();
        let seeds = (reader.seeds)();
        let mut bytes = mutate(seed.get(&seeds).bytes.clone(), changes);
        if let Some(end) = end {
            bytes.truncate(end.index(bytes.len() + 1));
        }
        reader.check(&bytes);
    }
}
