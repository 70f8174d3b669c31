"""Texts of files as what a user would build: graphs and linkages that compile."""

from blockmech import Graph, Linkage

graph_of, linkage_of = Graph.from_json, Linkage.from_json
