"""Graph files in an editor: completion, words on hover, mistakes while typing, by `lsp`."""
