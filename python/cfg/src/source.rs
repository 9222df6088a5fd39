//! Structs and enumerations of the Rust sources: fields, types, documentation, serde attributes.

use std::path::Path;
use syn::parse::{ParseStream, Parser as _};
use syn::{Attribute, Expr, Fields, File, Ident, ImplItem, Item, ItemMacro, Lit, LitStr, Meta, Token, Type};

/// A field of a struct or of a variant.
#[derive(Debug)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) ty: Type,
    pub(crate) doc: String,
    /// True if the value may be absent in a file: serde has a default for it, or it is optional.
    pub(crate) optional: bool,
}

/// A variant of an enumeration.
#[derive(Debug)]
pub(crate) struct Variant {
    pub(crate) name: String,
    pub(crate) doc: String,
    pub(crate) content: Content,
}

/// Content of a variant.
#[derive(Debug)]
pub(crate) enum Content {
    Nothing,
    Value(Type),
    Fields(Vec<Field>),
}

/// Reads a source file.
pub(crate) fn parse(root: &Path, file: &str) -> Result<File, String> {
    let text = std::fs::read_to_string(root.join(file)).map_err(|error| format!("{file}: {error}"))?;
    syn::parse_file(&text).map_err(|error| format!("{file}: {error}"))
}

/// Documentation and fields of a struct.
pub(crate) fn find_struct(file: &File, name: &str) -> Option<(String, Vec<Field>)> {
    file.items.iter().find_map(|item| match item {
        Item::Struct(item) if item.ident == name => {
            let default = serde_attributes(&item.attrs)
                .any(|attribute| attribute == "default" || attribute.starts_with("try_from"));
            Some((doc(&item.attrs), fields(&item.fields, default)))
        }
        Item::Macro(item) if item.mac.path.is_ident("fisheye") => {
            fisheye(item).filter(|(found, ..)| found == name).map(|(_, doc, field)| (doc, vec![field]))
        }
        Item::Macro(item) if item.mac.path.is_ident("imperfections") && name == "Imperfections" => {
            let doc = "Imperfections of a camera. A field that is `None`, the default, has no effect.";
            Some((doc.replace('`', "``"), imperfections(item)?))
        }
        _ => None,
    })
}

/// Name and documentation of a lens that `fisheye!` declares, and its only field.
fn fisheye(item: &ItemMacro) -> Option<(String, String, Field)> {
    let parse = |input: ParseStream<'_>| {
        let attributes = input.call(Attribute::parse_outer)?;
        let name: Ident = input.parse()?;
        input.parse::<Token![:]>()?;
        // The name in files and its aliases, then `angles up to $most, $allowed`.
        input.parse::<LitStr>()?;
        input.parse::<Token![,]>()?;
        input.parse::<Expr>()?;
        input.parse::<Token![;]>()?;
        (0..3).try_for_each(|_| input.parse::<Ident>().map(drop))?;
        input.parse::<Expr>()?;
        input.parse::<Token![,]>()?;
        let allowed: LitStr = input.parse()?;
        skip(input)?;
        let text = format!("Largest visible angle from the optical axis [rad]: {}.", allowed.value());
        let field = Field { name: "max_angle".into(), ty: syn::parse_str("f64")?, doc: text, optional: true };
        Ok((name.to_string(), doc(&attributes), field))
    };
    parse.parse2(item.mac.tokens.clone()).ok()
}

/// Fields of the struct that `imperfections!` declares: a list of those of light, and of those of depth.
fn imperfections(item: &ItemMacro) -> Option<Vec<Field>> {
    let parse = |input: ParseStream<'_>| {
        let mut fields = Vec::new();
        while !input.is_empty() {
            input.parse::<Ident>()?;
            let list;
            syn::braced!(list in input);
            while !list.is_empty() {
                let attributes = list.call(Attribute::parse_outer)?;
                let name: Ident = list.parse()?;
                list.parse::<Token![::]>()?;
                let ty: Ident = list.parse()?;
                list.parse::<Token![,]>()?;
                let ty = syn::parse_str(&format!("Option<{ty}>"))?;
                fields.push(Field { name: name.to_string(), ty, doc: doc(&attributes), optional: true });
            }
        }
        Ok(fields)
    };
    parse.parse2(item.mac.tokens.clone()).ok()
}

/// Skips the rest of the input of a macro.
fn skip(input: ParseStream<'_>) -> syn::Result<()> {
    while !input.is_empty() {
        input.step(|cursor| Ok(((), cursor.token_tree().map_or(*cursor, |(_, rest)| rest))))?;
    }
    Ok(())
}

/// Documentation and variants of an enumeration.
pub(crate) fn find_enum(file: &File, name: &str) -> Option<(String, Vec<Variant>)> {
    file.items.iter().find_map(|item| match item {
        Item::Enum(item) if item.ident == name => {
            let is_lowercase = serde_attributes(&item.attrs).any(|attribute| attribute == "rename_all=\"lowercase\"");
            let variant = |variant: &syn::Variant| {
                let renamed = serde_attributes(&variant.attrs).find_map(|attribute| {
                    attribute.strip_prefix("rename=").map(|name| name.trim_matches('"').to_string())
                });
                let content = match &variant.fields {
                    Fields::Unit => Content::Nothing,
                    Fields::Unnamed(values) => match values.unnamed.first() {
                        Some(value) => Content::Value(value.ty.clone()),
                        None => Content::Nothing,
                    },
                    Fields::Named(_) => Content::Fields(fields(&variant.fields, false)),
                };
                let plain = variant.ident.to_string();
                let name =
                    renamed.unwrap_or_else(|| if is_lowercase { plain.to_lowercase() } else { snake_case(&plain) });
                Variant { name, doc: doc(&variant.attrs), content }
            };
            Some((doc(&item.attrs), item.variants.iter().map(variant).collect()))
        }
        _ => None,
    })
}

/// Documentation of a method of a type, without its errors.
pub(crate) fn find_method(file: &File, owner: &str, name: &str) -> Option<String> {
    let methods = file.items.iter().filter_map(|item| match item {
        Item::Impl(item) if item.trait_.is_none() && is_named(&item.self_ty, owner) => Some(&item.items),
        _ => None,
    });
    let found = methods.flatten().find_map(|item| match item {
        ImplItem::Fn(method) if method.sig.ident == name => Some(doc(&method.attrs)),
        _ => None,
    })?;
    found.split("\n\n# Errors").next().map(String::from)
}

fn fields(fields: &Fields, default: bool) -> Vec<Field> {
    let field = |field: &syn::Field| {
        let name = field.ident.as_ref()?.to_string();
        // Not part of files.
        if serde_attributes(&field.attrs).any(|attribute| attribute == "skip") {
            return None;
        }
        let own_default = serde_attributes(&field.attrs).any(|attribute| attribute.starts_with("default"));
        let optional = default || own_default || is_option(&field.ty);
        Some(Field { name, ty: field.ty.clone(), doc: doc(&field.attrs), optional })
    };
    fields.iter().filter_map(field).collect()
}

fn is_option(ty: &Type) -> bool {
    is_named(ty, "Option")
}

fn is_named(ty: &Type, name: &str) -> bool {
    matches!(ty, Type::Path(path) if path.path.segments.last().is_some_and(|segment| segment.ident == name))
}

/// Arguments of `#[serde(...)]` without spaces: `default`, `rename="x"`.
fn serde_attributes(attributes: &[Attribute]) -> impl Iterator<Item = String> {
    attributes.iter().filter(|attribute| attribute.path().is_ident("serde")).flat_map(|attribute| {
        let Meta::List(list) = &attribute.meta else { return Vec::new() };
        list.tokens.to_string().split(',').map(|part| part.replace(' ', "")).collect()
    })
}

/// Documentation of an item, in the notation of Python's documentation.
fn doc(attributes: &[Attribute]) -> String {
    let line = |attribute: &Attribute| {
        let Meta::NameValue(pair) = &attribute.meta else { return None };
        let (true, Expr::Lit(literal)) = (pair.path.is_ident("doc"), &pair.value) else { return None };
        let Lit::Str(text) = &literal.lit else { return None };
        Some(text.value().strip_prefix(' ').map_or_else(|| text.value(), String::from))
    };
    let mut lines: Vec<String> = Vec::new();
    // Formulas are kept, programs are not.
    let mut code: Option<bool> = None;
    for line in attributes.iter().filter_map(line) {
        if let Some(language) = line.trim_start().strip_prefix("```") {
            code = if code.is_some() { None } else { Some(language == "text") };
        } else if code == Some(true) {
            lines.push(format!("    {}", line.trim_end()));
        } else if code.is_none() && !(line.is_empty() && lines.last().is_some_and(String::is_empty)) {
            lines.push(line.trim_end().to_string());
        }
    }
    while lines.last().is_some_and(String::is_empty) {
        lines.pop();
    }
    without_links(&lines.join("\n")).replace("\\[", "[").replace("\\]", "]").replace('`', "``").replace('\\', "\\\\")
}

/// Removes the targets of links, and their definitions.
fn without_links(text: &str) -> String {
    let mut kept = String::new();
    let mut rest = text;
    while let Some(open) = rest.find('[') {
        let (before, link) = rest.split_at(open);
        kept.push_str(before);
        // An escaped bracket is text.
        let end = if before.ends_with('\\') { None } else { closing(link, '[', ']') };
        let Some(end) = end else {
            kept.push('[');
            rest = &link[1..];
            continue;
        };
        let (label, after) = (&link[1..end], &link[end + 1..]);
        let target = after.starts_with('(').then(|| closing(after, '(', ')')).flatten();
        if target.is_none() && !label.starts_with('`') && !after.starts_with(':') {
            kept.push_str(&link[..=end]);
        } else {
            kept.push_str(label);
        }
        rest = target.map_or(after, |end| &after[end + 1..]);
        // The target of a definition is one word.
        let is_word = |text: &&str| text.lines().next().is_some_and(|line| line.split_whitespace().count() == 1);
        let is_alone = kept.rsplit('\n').next() == Some(label);
        if let Some(definition) = rest.strip_prefix(':').filter(|text| is_alone && is_word(text)) {
            kept.truncate(kept.len() - label.len());
            rest = definition.split_once('\n').map_or("", |(_, next)| next);
        }
    }
    kept.push_str(rest);
    kept.trim_end().to_string()
}

/// Position of the bracket that closes the first one.
fn closing(text: &str, open: char, close: char) -> Option<usize> {
    let mut depth = 0;
    text.char_indices().find_map(|(at, letter)| {
        depth += i32::from(letter == open) - i32::from(letter == close);
        (depth == 0).then_some(at)
    })
}

/// `ImplicitFast` as `implicit_fast`, as serde's `snake_case` does.
pub(crate) fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    for (at, letter) in name.char_indices() {
        if letter.is_uppercase() && at > 0 {
            snake.push('_');
        }
        snake.extend(letter.to_lowercase());
    }
    snake
}
