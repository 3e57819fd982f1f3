//! Formats lists and numbers for messages.

/// The names with commas between, or "none". Escaped, for a column's name may hold a line end.
pub(crate) fn none_or_list<S: AsRef<str>>(names: &[S]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    let names: Vec<String> = names
        .iter()
        .map(|name| name.as_ref().escape_debug().to_string())
        .collect();
    names.join(", ")
}

/// A piece of a file for an error: no more than a line can hold.
pub(crate) fn shorten(text: &str) -> String {
    const MAX_CHARS: usize = 32;
    if text.chars().count() <= MAX_CHARS {
        return text.to_owned();
    }
    text.chars().take(MAX_CHARS).chain("...".chars()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_shortened_at_a_character_not_inside_one() {
        assert_eq!(shorten("0.1"), "0.1");
        assert_eq!(shorten(&"é".repeat(40)), format!("{}...", "é".repeat(32)));
    }
}
