//! Patterns and compact lists of recorded field names.

/// Merges names that differ only in their brackets: `position[J1, J2]`, `data[0..11]` for the numbers 0 to 11.
pub(crate) fn group_fields(fields: &[String]) -> Vec<String> {
    let mut groups: Vec<((&str, &str), Vec<&str>)> = Vec::new();
    for field in fields {
        let parts = field.split_once('[').and_then(|(before, rest)| Some((before, rest.rsplit_once(']')?)));
        let (key, of) = match parts {
            Some((before, (of, after))) => ((before, after), Some(of)),
            None => ((field.as_str(), ""), None),
        };
        match groups.iter_mut().find(|(known, keys)| *known == key && keys.is_empty() == of.is_none()) {
            Some((_, keys)) => keys.extend(of),
            None => groups.push((key, of.into_iter().collect())),
        }
    }
    let text = |((before, after), keys): ((&str, &str), Vec<&str>)| {
        let numbered = keys.len() > 2 && keys.iter().enumerate().all(|(k, key)| key.parse() == Ok(k));
        match &keys[..] {
            [] => before.to_string(),
            keys if numbered => format!("{before}[0..{}]{after}", keys.len() - 1),
            keys => format!("{before}[{}]{after}", keys.join(", ")),
        }
    };
    groups.into_iter().map(text).collect()
}

/// True if a name matches a pattern, in which `*` stands for any characters.
pub(crate) fn matches_pattern(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else { return false };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else { return rest.is_empty() };
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns() {
        for (pattern, name, expected) in [
            ("position[J1]", "position[J1]", true),
            ("position[J1]", "position[J12]", false),
            ("position[*]", "position[J1]", true),
            ("*[J1]", "velocity[J1]", true),
            ("pos*J*]", "position[J1]", true),
            ("*", "", true),
            ("", "x", false),
            ("a*a", "a", false),
        ] {
            assert_eq!(matches_pattern(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn short_lists() {
        let fields = ["a", "p[x]", "p[y]", "d[0]", "d[1]", "d[2]", "t[l].x", "t[r].x", "t[l].y"].map(String::from);
        assert_eq!(group_fields(&fields), ["a", "p[x, y]", "d[0..2]", "t[l, r].x", "t[l].y"]);
    }
}
