//! Checks that there is room for an array before it is allocated: a failed allocation ends the
//! program.
//!
//! The allocator alone does not tell. Linux grants memory that does not exist, and kills the program
//! that uses it. Large arrays are therefore compared with the memory that the system reports as
//! available, to this program's control group, too.

use crate::error::{Error, Result};

/// Bytes that are asked of the allocator alone: there is as good as always room for them.
const SMALL: u64 = 1 << 26;

/// Whether an array of this size can be made. Entries count as `f64`, which layers are drawn in and
/// problems factorized in whatever they are kept in.
///
/// # Errors
/// [`Error::TooLarge`].
pub(crate) fn check_room(what: &'static str, rows: usize, columns: usize) -> Result<()> {
    check_copies(what, rows, columns, 1)
}

/// As [`check_room`], for several arrays of this size at a time.
pub(crate) fn check_copies(
    what: &'static str,
    rows: usize,
    columns: usize,
    copies: usize,
) -> Result<()> {
    let too_large = Error::TooLarge {
        what,
        rows,
        columns,
    };
    let entries = rows
        .checked_mul(columns)
        .and_then(|one| one.checked_mul(copies));
    let bytes = entries.and_then(|entries| entries.checked_mul(size_of::<f64>()));
    let (Some(entries), Some(bytes)) = (entries, bytes) else {
        return Err(too_large);
    };
    if Vec::<f64>::new().try_reserve_exact(entries).is_err() {
        return Err(too_large);
    }
    let bytes = bytes as u64;
    if bytes > SMALL && system::available().is_some_and(|available| bytes > available) {
        return Err(too_large);
    }
    Ok(())
}

#[cfg(not(target_os = "linux"))]
mod system {
    /// Other systems do not promise what they have not got, or do not say.
    pub(super) fn available() -> Option<u64> {
        None
    }
}

#[cfg(target_os = "linux")]
mod system {
    use std::fs;
    use std::path::Path;

    /// Bytes that can be had without ending a program, where that is known.
    pub(super) fn available() -> Option<u64> {
        let machine = fs::read_to_string("/proc/meminfo").ok().and_then(|text| {
            let available = field(&text, "MemAvailable:")?;
            let swap = field(&text, "SwapFree:").unwrap_or(0);
            Some(available.saturating_add(swap).saturating_mul(1024))
        });
        let groups = fs::read_to_string("/proc/self/cgroup").ok();
        let group = groups.and_then(|groups| groups.lines().filter_map(of_group).min());
        machine.into_iter().chain(group).min()
    }

    /// The number behind this name in lines of names and numbers.
    pub(super) fn field(text: &str, name: &str) -> Option<u64> {
        let line = text.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse().ok()
    }

    /// What is left to a control group, given by its line, and to those that it is in.
    fn of_group(line: &str) -> Option<u64> {
        let (_, rest) = line.split_once(':')?;
        let (controllers, path) = rest.split_once(':')?;
        // Of the second version, whose controllers have no names here, and of the first.
        let (root, most, current, cached) = match controllers {
            "" => (
                "/sys/fs/cgroup",
                "memory.max",
                "memory.current",
                "inactive_file ",
            ),
            "memory" => (
                "/sys/fs/cgroup/memory",
                "memory.limit_in_bytes",
                "memory.usage_in_bytes",
                "total_inactive_file ",
            ),
            _ => return None,
        };
        let own = Path::new(path.trim_start_matches('/'));
        let left = own.ancestors().filter_map(|group| {
            let folder = Path::new(root).join(group);
            let number = |name: &str| -> Option<u64> {
                let text = fs::read_to_string(folder.join(name)).ok()?;
                text.trim().parse().ok()
            };
            // Files that were read are dropped before anybody is ended.
            let stat = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
            let cached = field(&stat, cached).unwrap_or(0);
            let used = number(current)?.saturating_sub(cached);
            Some(number(most)?.saturating_sub(used))
        });
        left.min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_beyond_any_memory_are_refused_and_small_ones_are_not() {
        for (rows, columns) in [(usize::MAX, 2), (1 << 40, 1 << 20), (1 << 45, 1)] {
            let refused = check_room("an array", rows, columns);
            assert!(matches!(refused, Err(Error::TooLarge { .. })));
        }
        assert_eq!(check_copies("an array", 1000, 1000, 4), Ok(()));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn more_than_the_system_has_left_is_refused_although_it_would_be_granted() {
        let Some(available) = system::available() else {
            return;
        };
        let rows = usize::try_from(available / 8).unwrap();
        let refused = check_room("an array", rows, 2);
        assert!(matches!(refused, Err(Error::TooLarge { .. })));
        let text = "MemTotal:       100 kB\nMemAvailable:    60 kB\n";
        assert_eq!(system::field(text, "MemAvailable:"), Some(60));
        assert_eq!(system::field(text, "SwapFree:"), None);
    }
}
