class Live: pass
