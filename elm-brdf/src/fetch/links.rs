//! The links of an HTML page, as its author wrote them.

/// A link.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Link {
    /// Where it leads: an address, absolute or relative to the page.
    pub(super) href: String,
    /// What a reader sees of it, without tags.
    pub(super) text: String,
}

impl Link {
    /// The last part of the address's path.
    pub(super) fn file(&self) -> &str {
        let path = self.href.split(['?', '#']).next().unwrap_or_default();
        path.rsplit('/').next().unwrap_or_default()
    }
}

/// All `<a href=...>` of a page, in order. Comments are passed over; what is no HTML gives few
/// links or none.
pub(super) fn links(html: &str) -> Vec<Link> {
    let mut links: Vec<Link> = Vec::new();
    // Whether text belongs to the last link.
    let mut within = false;
    let mut rest = html;
    while let Some((text, tail)) = rest.split_once('<') {
        append(&mut links, within, text);
        if let Some(comment) = tail.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
            continue;
        }
        if !tail.starts_with(|c: char| c.is_ascii_alphabetic() || matches!(c, '/' | '!' | '?')) {
            // A sign, not a tag.
            append(&mut links, within, "<");
            rest = tail;
            continue;
        }
        let (name, attributes) = word(tail);
        if name.eq_ignore_ascii_case("a") {
            let (href, after) = href(attributes);
            within = href.is_some();
            let text = String::new();
            links.extend(href.map(|href| Link { href, text }));
            rest = after;
        } else {
            within &= !name.eq_ignore_ascii_case("/a");
            rest = tail.split_once('>').map_or("", |(_, after)| after);
        }
    }
    append(&mut links, within, rest);
    links
}

fn append(links: &mut [Link], within: bool, text: &str) {
    if let (true, Some(link)) = (within, links.last_mut()) {
        link.text.push_str(text);
    }
}

/// The text as far as it goes before a blank or a tag's punctuation, and the rest.
fn word(text: &str) -> (&str, &str) {
    let end = text.find(|c: char| c.is_ascii_whitespace() || matches!(c, '>' | '='));
    text.split_at(end.unwrap_or(text.len()))
}

/// The address among the attributes of a tag, and what follows the tag.
fn href(mut rest: &str) -> (Option<String>, &str) {
    let mut found = None;
    loop {
        rest = rest.trim_ascii_start();
        if let Some(after) = rest.strip_prefix('>') {
            return (found, after);
        }
        if rest.is_empty() {
            return (None, "");
        }
        let (name, after) = word(rest);
        let Some(after) = after.trim_ascii_start().strip_prefix('=') else {
            // An attribute without a value.
            rest = after;
            continue;
        };
        let value;
        (value, rest) = quoted(after.trim_ascii_start());
        if name.eq_ignore_ascii_case("href") && found.is_none() {
            found = Some(value.trim_ascii().replace("&amp;", "&"));
        }
    }
}

/// The value of an attribute, with or without quotes, and the rest.
fn quoted(text: &str) -> (&str, &str) {
    for quote in ['"', '\''] {
        if let Some(inner) = text.strip_prefix(quote) {
            return inner.split_once(quote).unwrap_or((inner, ""));
        }
    }
    let end = text.find(|c: char| c.is_ascii_whitespace() || c == '>');
    text.split_at(end.unwrap_or(text.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pairs(html: &str) -> Vec<(String, String)> {
        let links = links(html).into_iter();
        links.map(|link| (link.href, link.text)).collect()
    }

    #[test]
    fn links_are_found_however_they_are_written() {
        for (html, href, text) in [
            ("<a href=\"x.dat\">x</a> y", "x.dat", "x"),
            ("<A HREF='../x.dat' >a <b>b</b></A>", "../x.dat", "a b"),
            ("<a class=z\nhref = /d/x.dat>x</a>", "/d/x.dat", "x"),
            ("<a href=x.dat>", "x.dat", ""),
            ("<a name=t href=\"a?b=1&amp;c\" download>t", "a?b=1&c", "t"),
            ("1 < 2 <a\thref=\" x \">x</a>", "x", "x"),
            ("<!-- <a href=no> --><a href=yes>", "yes", ""),
        ] {
            assert_eq!(pairs(html), [(href.to_owned(), text.to_owned())], "{html}");
        }
    }

    #[test]
    fn other_tags_and_broken_ones_are_no_links() {
        for html in [
            "",
            "<",
            "<a",
            "<a href",
            "<a href=",
            "<a href=\"x",
            "<abbr href=x>",
            "<a name=x>",
            "<!-- <a href=x>",
        ] {
            assert_eq!(links(html), [], "{html}");
        }
    }

    #[test]
    fn a_file_is_the_last_part_of_the_path() {
        for (href, file) in [
            ("x.dat", "x.dat"),
            ("http://h/a/x.dat?b=/c#d", "x.dat"),
            ("a/", ""),
            ("", ""),
        ] {
            let (href, text) = (href.to_owned(), String::new());
            assert_eq!(Link { href, text }.file(), file);
        }
    }

    proptest! {
        #[test]
        fn no_page_is_a_reason_to_panic(page in "[<a href=\"'x>!-/& é]{0,60}") {
            let _ = links(&page);
        }
    }
}
